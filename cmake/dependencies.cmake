# Third-party libraries, all from Python wheels; nothing is installed on the system.
#
# stickslip_eigen: Eigen's headers from the wheel cmeel-eigen.
#
# stickslip_urdfdom: urdfdom, its headers, tinyxml2 and console_bridge from the wheels cmeel-urdfdom[build]. cmeel puts them
# under <site-packages>/cmeel.prefix. Searched, in this order: STICKSLIP_CMEEL_PREFIX, every entry of CMAKE_PREFIX_PATH
# (where scikit-build-core lists the site-packages of its isolated build environment), the interpreter's sys.path. Nothing of
# it is cached: the next isolated environment lies elsewhere. At run time the wheel lies beside the installed package, which
# is what the install rpath of the Python module says.
set(STICKSLIP_CMEEL_PREFIX "" CACHE PATH "The cmeel.prefix folder that holds urdfdom; empty: ask the Python interpreter")

set(STICKSLIP_PYTHON_COMPONENTS Interpreter)
if(STICKSLIP_PYTHON)
  list(APPEND STICKSLIP_PYTHON_COMPONENTS Development.Module)
  # In a scikit-build-core run, the stable ABI is only asked for where the wheel is tagged for it.
  if(SKBUILD_SABI_COMPONENT)
    list(APPEND STICKSLIP_PYTHON_COMPONENTS ${SKBUILD_SABI_COMPONENT})
  endif()
endif()
find_package(Python 3.10 REQUIRED COMPONENTS ${STICKSLIP_PYTHON_COMPONENTS})

# The folders where a cmeel.prefix may lie, best first.
function(stickslip_cmeel_candidates result)
  set(candidates ${STICKSLIP_CMEEL_PREFIX})
  set(prefixes ${CMAKE_PREFIX_PATH})
  if(DEFINED ENV{CMAKE_PREFIX_PATH})
    string(REPLACE ":" ";" from_environment "$ENV{CMAKE_PREFIX_PATH}")
    list(APPEND prefixes ${from_environment})
  endif()
  foreach(prefix IN LISTS prefixes)
    file(GLOB in_environment "${prefix}/lib/python3*/site-packages/cmeel.prefix")
    list(APPEND candidates "${prefix}" "${prefix}/cmeel.prefix" ${in_environment})
  endforeach()
  execute_process(
    COMMAND "${Python_EXECUTABLE}" -c "import sys; print(';'.join(p + '/cmeel.prefix' for p in sys.path if p))"
    OUTPUT_VARIABLE from_python OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
  list(APPEND candidates ${from_python})
  set(${result} ${candidates} PARENT_SCOPE)
endfunction()

stickslip_cmeel_candidates(candidates)
set(cmeel_prefix "")
foreach(candidate IN LISTS candidates)
  if(EXISTS "${candidate}/lib/liburdfdom_model.so" AND EXISTS "${candidate}/include/tinyxml2.h"
     AND EXISTS "${candidate}/include/urdfdom_headers/urdf_model/model.h" AND EXISTS "${candidate}/include/eigen3/Eigen/Core")
    set(cmeel_prefix "${candidate}")
    break()
  endif()
endforeach()
if(NOT cmeel_prefix)
  list(REMOVE_DUPLICATES candidates)
  list(JOIN candidates "\n  " candidates)
  message(FATAL_ERROR
    "urdfdom and Eigen were not found. Install them with\n  ${Python_EXECUTABLE} -m pip install 'cmeel-urdfdom[build]>=6,<7' 'cmeel-eigen>=3.4'\n"
    "or pass -DPython_EXECUTABLE=<the interpreter that has it> or -DSTICKSLIP_CMEEL_PREFIX=<its cmeel.prefix>. "
    "Looked in:\n  ${candidates}")
endif()
message(STATUS "urdfdom, Eigen: ${cmeel_prefix}")

add_library(stickslip_urdfdom INTERFACE)
foreach(name urdfdom_model tinyxml2 console_bridge)
  # Imported as shared libraries, so that the build tree gets a run path and tests need no LD_LIBRARY_PATH.
  add_library(stickslip_${name} SHARED IMPORTED GLOBAL)
  set_target_properties(stickslip_${name} PROPERTIES IMPORTED_LOCATION "${cmeel_prefix}/lib/lib${name}.so")
  target_link_libraries(stickslip_urdfdom INTERFACE stickslip_${name})
endforeach()
# Copies of what is used: <prefix>/include itself may hold other people's wheels (Boost, Eigen).
file(COPY "${cmeel_prefix}/include/tinyxml2.h" "${cmeel_prefix}/include/console_bridge"
  DESTINATION "${CMAKE_BINARY_DIR}/urdfdom_include")
target_include_directories(stickslip_urdfdom SYSTEM INTERFACE
  "${CMAKE_BINARY_DIR}/urdfdom_include" "${cmeel_prefix}/include/urdfdom" "${cmeel_prefix}/include/urdfdom_headers")

# stickslip_eigen: linear algebra beyond robot size (header only).
file(COPY "${cmeel_prefix}/include/eigen3" DESTINATION "${CMAKE_BINARY_DIR}")
add_library(stickslip_eigen INTERFACE)
target_include_directories(stickslip_eigen SYSTEM INTERFACE "${CMAKE_BINARY_DIR}/eigen3")
target_compile_definitions(stickslip_eigen INTERFACE EIGEN_MPL2_ONLY EIGEN_DONT_PARALLELIZE)
