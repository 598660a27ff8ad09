// The extension module stickslip._core: plain bindings. The documented front is in
// python/stickslip/*.py.
#include <stickslip/errors.h>

#include "bindings.h"

namespace nb = nanobind;

NB_MODULE(_core, m) {
  // Arrays of a batch that PyTorch or JAX still hold at exit are no leak.
  nb::set_leak_warnings(false);
  m.doc() = "C++ core of stickslip. Use the names of the package `stickslip`; these may change.";

  nb::register_exception_translator([](const std::exception_ptr& p, void*) {
    try {
      std::rethrow_exception(p);
    } catch (const stickslip::FileError& e) {
      PyErr_SetString(PyExc_FileNotFoundError, e.what());
    }
  });

#if defined(__clang__)
  m.attr("compiler") = "Clang " __clang_version__;
#else
  m.attr("compiler") = "GCC " __VERSION__;
#endif

  stickslip::python::bind_model(m);
  stickslip::python::bind_contact(m);
  stickslip::python::bind_world(m);
  stickslip::python::bind_batch(m);
  stickslip::python::bind_scenes(m);
  stickslip::python::bind_problems(m);
}
