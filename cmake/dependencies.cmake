# What the build takes from outside: urdfdom, from the PyPI wheel cmeel-urdfdom. Nothing is taken from the system.
#
# Python is asked where the wheel lies (-DPython_EXECUTABLE=... chooses the Python). Without the wheel there,
# CMAKE_PREFIX_PATH is searched. In an isolated pip build the wheel lies in the build environment, and at run time beside the
# installed package, which is what the install rpath of the Python module says.
set(STICKSLIP_PYTHON_COMPONENTS Interpreter)
if(STICKSLIP_PYTHON)
  list(APPEND STICKSLIP_PYTHON_COMPONENTS Development.Module)
  # In a scikit-build-core run, the stable ABI is only asked for where the wheel is tagged for it.
  if(SKBUILD_SABI_COMPONENT)
    list(APPEND STICKSLIP_PYTHON_COMPONENTS ${SKBUILD_SABI_COMPONENT})
  endif()
endif()
find_package(Python 3.10 REQUIRED COMPONENTS ${STICKSLIP_PYTHON_COMPONENTS})

execute_process(
  COMMAND ${Python_EXECUTABLE} -c
          "from importlib.metadata import distribution as d; print(d('cmeel-urdfdom').locate_file('cmeel.prefix').resolve())"
  OUTPUT_VARIABLE stickslip_cmeel_prefix OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)

set(stickslip_search NO_CMAKE_SYSTEM_PATH NO_SYSTEM_ENVIRONMENT_PATH)
find_path(STICKSLIP_URDFDOM_INCLUDE urdf_parser/urdf_parser.h HINTS ${stickslip_cmeel_prefix}
          PATH_SUFFIXES include/urdfdom urdfdom ${stickslip_search})
find_path(STICKSLIP_URDFDOM_HEADERS_INCLUDE urdf_model/model.h HINTS ${stickslip_cmeel_prefix}
          PATH_SUFFIXES include/urdfdom_headers urdfdom_headers ${stickslip_search})
foreach(lib urdfdom_model console_bridge tinyxml2)
  find_library(STICKSLIP_LIB_${lib} ${lib} HINTS ${stickslip_cmeel_prefix} PATH_SUFFIXES lib ${stickslip_search})
endforeach()
if(NOT STICKSLIP_URDFDOM_INCLUDE OR NOT STICKSLIP_URDFDOM_HEADERS_INCLUDE OR NOT STICKSLIP_LIB_urdfdom_model
   OR NOT STICKSLIP_LIB_console_bridge OR NOT STICKSLIP_LIB_tinyxml2)
  message(FATAL_ERROR "urdfdom was not found. Install it for the Python of this build:\n"
                      "  ${Python_EXECUTABLE} -m pip install 'cmeel-urdfdom[build]'\n"
                      "or choose a Python that has it with -DPython_EXECUTABLE=...")
endif()

# urdfdom reports through console_bridge; its errors become ours, so both are linked. The imported libraries' full paths give
# programs of the build tree their rpath: tests run without LD_LIBRARY_PATH.
add_library(stickslip_urdfdom INTERFACE)
target_include_directories(stickslip_urdfdom SYSTEM INTERFACE ${STICKSLIP_URDFDOM_INCLUDE} ${STICKSLIP_URDFDOM_INCLUDE}/..
                           ${STICKSLIP_URDFDOM_HEADERS_INCLUDE})
target_link_libraries(stickslip_urdfdom INTERFACE ${STICKSLIP_LIB_urdfdom_model} ${STICKSLIP_LIB_console_bridge}
                      ${STICKSLIP_LIB_tinyxml2})
