// Batch. Shapes, names and checks of what comes in live in python/stickslip/batch.py.
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>
#include <stickslip/batch.h>

#include <algorithm>

#include "bindings.h"
#include "words.h"

namespace nb = nanobind;
using namespace nb::literals;

namespace stickslip::python {
namespace {

constexpr Word<Precision> kPrecisions[] = {
    {"float32", Precision::kFloat32},
    {"float64", Precision::kFloat64},
};
constexpr Word<BatchField> kFields[] = {
    {"q", BatchField::kQ},
    {"u", BatchField::kU},
    {"generalized_force", BatchField::kGeneralizedForce},
    {"pd_target", BatchField::kPdTarget},
    {"contact_impulse", BatchField::kContactImpulse},
    {"contact_active", BatchField::kContactActive},
    {"status", BatchField::kStatus},
    {"residual", BatchField::kResidual},
    {"time", BatchField::kTime},
    {"kp", BatchField::kKp},
    {"kd", BatchField::kKd},
    {"friction", BatchField::kFriction},
    {"gravity", BatchField::kGravity},
    {"body_mass", BatchField::kBodyMass},
    {"body_com", BatchField::kBodyCom},
    {"body_inertia", BatchField::kBodyInertia},
    {"external_wrench", BatchField::kExternalWrench},
};

using IndicesIn = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
/// A view of the batch's own memory, writable. Unlike everything else that goes out: these arrays
/// are how a batch is driven.
using ViewOut = nb::ndarray<nb::numpy>;

nb::dlpack::dtype dtype_of(NumberType type) {
  switch (type) {
    case NumberType::kFloat32:
      return nb::dtype<float>();
    case NumberType::kFloat64:
      return nb::dtype<double>();
    case NumberType::kUint8:
      return nb::dtype<std::uint8_t>();
    default:
      return nb::dtype<std::uint32_t>();
  }
}

/// The view holds the Python object of the batch, so that the memory lives as long as any view.
ViewOut array(nb::handle_t<Batch> self, const std::string& field) {
  const BatchArray a = nb::cast<Batch&>(self).array(choice("field", field, kFields));
  const std::vector<std::size_t> shape(a.shape.begin(), a.shape.end());
  return ViewOut(a.data, shape.size(), shape.data(), self, nullptr, dtype_of(a.type));
}

/// Without the GIL. Between parts of a long run Ctrl-C is heard.
std::uint32_t step(Batch& batch, int steps) {
  const auto no_signal = [] {
    const nb::gil_scoped_acquire interpreter;
    return PyErr_CheckSignals() == 0;
  };
  std::uint32_t bits;
  {
    const nb::gil_scoped_release free_interpreter;
    bits = static_cast<std::uint32_t>(batch.step(steps, no_signal));
  }
  if (PyErr_Occurred()) throw nb::python_error();
  return bits;
}

void reset(Batch& batch, const IndicesIn& envs, const VectorIn& q, const VectorIn& u) {
  batch.reset({envs.data(), envs.size()}, span_of(q), span_of(u));
}

nb::bytes save_state(const Batch& batch) {
  const std::vector<std::uint8_t> blob = batch.save_state();
  return nb::bytes(blob.data(), blob.size());
}

void load_state(Batch& batch, const nb::bytes& blob) {
  const auto* data = static_cast<const std::uint8_t*>(blob.data());
  batch.load_state({data, blob.size()});
}

void init_batch(Batch* self, const World& world, int num_envs, const std::string& precision,
                int num_threads, bool pin_threads, const std::string& instruction_set,
                int regroup_every, int width) {
  BatchOptions options;
  options.num_envs = num_envs;
  options.precision = choice("dtype", precision, kPrecisions);
  options.num_threads = num_threads;
  options.pin_threads = pin_threads;
  options.instruction_set = instruction_set;
  options.regroup_every = regroup_every;
  options.width = width;
  new (self) Batch(world, options);
}

}  // namespace

void bind_batch(nb::module_& m) {
  nb::class_<ContactPoint>(m, "ContactPoint")
      .def_ro("body", &ContactPoint::body)
      .def_ro("shape", &ContactPoint::shape)
      .def_ro("point", &ContactPoint::point);
  nb::class_<Batch>(m, "Batch")
      .def("__init__", &init_batch, "world"_a, "num_envs"_a, "precision"_a, "num_threads"_a,
           "pin_threads"_a, "instruction_set"_a, "regroup_every"_a, "width"_a = 0)
      .def_prop_ro("model", &Batch::model_ptr)
      .def_prop_ro("num_envs", &Batch::num_envs)
      .def_prop_ro("precision", [](const Batch& b) { return word_for(b.precision(), kPrecisions); })
      .def_prop_ro("num_threads", &Batch::num_threads)
      .def_prop_ro("instruction_set", &Batch::instruction_set)
      .def_prop_ro("width", &Batch::width)
      .def_prop_ro("time_step", [](const Batch& b) { return b.world_options().time_step; })
      .def_prop_ro("memory_bytes", &Batch::memory_bytes)
      .def_prop_ro("contact_points", [](const Batch& b) { return b.contact_points(); })
      .def_prop_ro("contact_shapes", [](const Batch& b) { return b.contact_shapes(); })
      .def("array", &array, "field"_a)
      .def("step", &step, "steps"_a)
      .def("reset", &reset, "envs"_a, "q"_a, "u"_a)
      .def("save_state", &save_state)
      .def("load_state", &load_state, "blob"_a)
      .def("set_profiling", &Batch::set_profiling, "on"_a)
      .def_prop_ro("stage_times", [](const Batch& b) { return b.stage_times(); })
      .def("reset_stage_times", &Batch::reset_stage_times);
}

}  // namespace stickslip::python
