// World and Robot. Words for enumerations, shapes and units live in python/stickslip/world.py.
#include <nanobind/stl/array.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>
#include <stickslip/errors.h>
#include <stickslip/world.h>

#include <algorithm>

#include "bindings.h"
#include "layout/ground_shapes.h"
#include "words.h"

namespace nb = nanobind;
using namespace nb::literals;

namespace stickslip::python {
namespace {

std::size_t dofs(const Robot& robot) { return static_cast<std::size_t>(robot.model().nu()); }

ArrayOut array3(const Vector3& v) { return copy_array(v); }

/// Steps one by one so that the step at which a robot overflowed is known, without the GIL, and
/// lets Ctrl-C through. Returns the status bits and the number of steps taken.
nb::tuple step(World& world, int steps) {
  if (steps < 0)
    throw ModelError("step: steps is " + std::to_string(steps) + ", it must be zero or positive");
  constexpr int kStepsBetweenSignals = 512;
  std::uint32_t bits = 0;
  int done = 0;
  const auto overflowed = [&] {
    return (bits & static_cast<std::uint32_t>(StepStatus::kNonFinite)) != 0;
  };
  while (done < steps && !overflowed()) {
    const int end = std::min(steps, done + kStepsBetweenSignals);
    {
      nb::gil_scoped_release free_interpreter;
      for (; done < end && !overflowed(); ++done) bits |= static_cast<std::uint32_t>(world.step(1));
    }
    if (PyErr_CheckSignals() != 0) throw nb::python_error();
  }
  return nb::make_tuple(bits, done);
}

nb::bytes save_state(const World& world) {
  const std::vector<std::uint8_t> blob = world.save_state();
  return nb::bytes(blob.data(), blob.size());
}

void load_state(World& world, const nb::bytes& blob) {
  const auto* data = static_cast<const std::uint8_t*>(blob.data());
  world.load_state({data, blob.size()});
}

/// (delassus (3n, 3n), free velocity (3n,), friction (n,)).
nb::tuple arrays_of(const ContactProblem& problem) {
  const std::size_t rows = problem.free_velocity.size();
  const auto copy = [&](std::span<double> to) {
    std::copy(problem.delassus.begin(), problem.delassus.end(), to.begin());
  };
  return nb::make_tuple(make_array({rows, rows}, copy), copy_array(problem.free_velocity),
                        copy_array(problem.friction));
}

/// Delassus operator, free velocity and friction of the next step.
nb::tuple next_contact_problem(World& world, int robot) {
  return arrays_of(world.next_contact_problem(robot));
}

/// ((delassus, free velocity, friction), impulse (3n,)) of the last step.
nb::tuple last_contact_problem(const World& world, int robot) {
  std::vector<double> impulse;
  const ContactProblem problem = world.last_contact_problem(robot, &impulse);
  return nb::make_tuple(arrays_of(problem), copy_array(impulse));
}

ArrayOut delassus(const Robot& robot, const std::vector<int>& bodies,
                  const std::vector<Vector3>& points) {
  const std::size_t rows = 3 * points.size();
  return make_array({rows, rows},
                    [&](std::span<double> out) { robot.delassus(bodies, points, out); });
}

void init_world(World* self, double time_step, const Vector3& gravity,
                const std::string& integrator, int max_substeps, const std::string& method,
                const std::string& law, const std::string& single_contact, double tolerance,
                double relative_tolerance, int max_sweeps, double alpha, double alpha_min,
                double gamma, bool warm_start) {
  WorldOptions options;
  options.time_step = time_step;
  options.gravity = gravity;
  options.integrator = choice("integrator", integrator, kIntegrators);
  options.max_substeps = max_substeps;
  options.solver.method = choice("method", method, kStepMethods);
  options.solver.law = choice("law", law, kFrictionLaws);
  options.solver.single_contact = choice("single_contact", single_contact, kSingleContactMethods);
  options.solver.tolerance = tolerance;
  options.solver.relative_tolerance = relative_tolerance;
  options.solver.max_sweeps = max_sweeps;
  options.solver.alpha = alpha;
  options.solver.alpha_min = alpha_min;
  options.solver.gamma = gamma;
  options.solver.warm_start = warm_start;
  new (self) World(options);
}

void bind_records(nb::module_& m) {
  nb::class_<Contact>(m, "Contact")
      .def_ro("robot", &Contact::robot)
      .def_ro("body", &Contact::body)
      .def_ro("shape", &Contact::shape)
      .def_ro("point", &Contact::point)
      .def_ro("gap", &Contact::gap)
      .def_ro("friction", &Contact::friction)
      .def_prop_ro(
          "position", [](const Contact& c) { return array3(c.position); }, nb::rv_policy::move)
      .def_prop_ro(
          "normal", [](const Contact& c) { return array3(c.normal); }, nb::rv_policy::move)
      .def_prop_ro(
          "impulse", [](const Contact& c) { return array3(c.impulse); }, nb::rv_policy::move)
      .def_prop_ro(
          "velocity", [](const Contact& c) { return array3(c.velocity); }, nb::rv_policy::move);
  nb::class_<StepInfo>(m, "StepInfo")
      .def_prop_ro("status", [](const StepInfo& i) { return static_cast<std::uint32_t>(i.status); })
      .def_ro("contacts", &StepInfo::contacts)
      .def_ro("sweeps", &StepInfo::sweeps)
      .def_ro("newton_steps", &StepInfo::newton_steps)
      .def_ro("substeps", &StepInfo::substeps)
      .def_ro("residual", &StepInfo::residual);
  nb::class_<StageTimes>(m, "StageTimes")
      .def_ro("dynamics", &StageTimes::dynamics)
      .def_ro("detection", &StageTimes::detection)
      .def_ro("delassus", &StageTimes::delassus)
      .def_ro("solve", &StageTimes::solve)
      .def_ro("integrate", &StageTimes::integrate)
      .def_ro("steps", &StageTimes::steps);
}

void bind_robot(nb::module_& m) {
  nb::class_<Robot>(m, "Robot")
      .def_prop_ro("name", &Robot::name)
      .def_prop_ro("model", &Robot::model_ptr)
      .def_prop_ro(
          "q", [](const Robot& r) { return copy_array(r.q()); }, nb::rv_policy::move)
      .def_prop_ro(
          "u", [](const Robot& r) { return copy_array(r.u()); }, nb::rv_policy::move)
      .def(
          "set_state",
          [](Robot& r, const VectorIn& q, const VectorIn& u) {
            r.set_state(span_of(q), span_of(u));
          },
          "q"_a, "u"_a)
      .def_prop_rw(
          "generalized_force", [](const Robot& r) { return copy_array(r.generalized_force()); },
          [](Robot& r, const VectorIn& tau) { r.set_generalized_force(span_of(tau)); },
          nb::rv_policy::move)
      .def(
          "set_pd_gains",
          [](Robot& r, const VectorIn& kp, const VectorIn& kd) {
            r.set_pd_gains(span_of(kp), span_of(kd));
          },
          "kp"_a, "kd"_a)
      .def_prop_ro(
          "pd_kp", [](const Robot& r) { return copy_array(r.pd_kp()); }, nb::rv_policy::move)
      .def_prop_ro(
          "pd_kd", [](const Robot& r) { return copy_array(r.pd_kd()); }, nb::rv_policy::move)
      .def_prop_rw(
          "pd_target", [](const Robot& r) { return copy_array(r.pd_target()); },
          [](Robot& r, const VectorIn& target) { r.set_pd_target(span_of(target)); },
          nb::rv_policy::move)
      .def("mass_matrix",
           [](const Robot& r) {
             return make_array({dofs(r), dofs(r)},
                               [&](std::span<double> out) { r.mass_matrix(out); });
           })
      .def("bias_force",
           [](const Robot& r) {
             return make_array({dofs(r)}, [&](std::span<double> out) { r.bias_force(out); });
           })
      .def(
          "forward_dynamics",
          [](const Robot& r, const VectorIn& tau) {
            return make_array(
                {dofs(r)}, [&](std::span<double> out) { r.forward_dynamics(span_of(tau), out); });
          },
          "tau"_a)
      .def(
          "jacobian",
          [](const Robot& r, const std::string& frame) {
            return make_array({6, dofs(r)}, [&](std::span<double> out) { r.jacobian(frame, out); });
          },
          "frame"_a)
      .def("frame_pose", &Robot::frame_pose, "frame"_a)
      .def("delassus", &delassus, "bodies"_a, "points"_a)
      .def_prop_ro("kinetic_energy", &Robot::kinetic_energy)
      .def_prop_ro("mechanical_energy", &Robot::mechanical_energy)
      .def_prop_ro("potential_energy", &Robot::potential_energy)
      .def_prop_ro(
          "center_of_mass", [](const Robot& r) { return array3(r.center_of_mass()); },
          nb::rv_policy::move)
      .def_prop_ro(
          "linear_momentum", [](const Robot& r) { return array3(r.linear_momentum()); },
          nb::rv_policy::move)
      .def_prop_ro(
          "angular_momentum", [](const Robot& r) { return array3(r.angular_momentum()); },
          nb::rv_policy::move)
      .def_prop_ro("info", [](const Robot& r) { return r.info(); })
      .def_prop_ro("contacts", [](const Robot& r) {
        return std::vector<Contact>(r.contacts().begin(), r.contacts().end());
      });
}

}  // namespace

void bind_world(nb::module_& m) {
  bind_records(m);
  bind_robot(m);
  m.def("unsupported_shapes", &layout::unsupported_shapes, "model"_a,
        "Indices of shapes that no contact is computed for.");
  nb::class_<World>(m, "World")
      .def("__init__", &init_world, "time_step"_a, "gravity"_a, "integrator"_a, "max_substeps"_a,
           "method"_a, "law"_a, "single_contact"_a, "tolerance"_a, "relative_tolerance"_a,
           "max_sweeps"_a, "alpha"_a, "alpha_min"_a, "gamma"_a, "warm_start"_a)
      .def_prop_ro("time_step", [](const World& w) { return w.options().time_step; })
      .def_prop_ro(
          "gravity", [](const World& w) { return array3(w.options().gravity); },
          nb::rv_policy::move)
      .def_prop_ro("integrator",
                   [](const World& w) { return word_for(w.options().integrator, kIntegrators); })
      .def("add_ground", &World::add_ground, "height"_a, "material"_a)
      .def(
          "add_robot",
          [](World& w, ModelPtr model, const std::string& name, const Vector3& position,
             const std::array<double, 4>& orientation, const std::string& material) -> Robot& {
            return w.add_robot(std::move(model), {name, position, orientation, material});
          },
          "model"_a, "name"_a, "position"_a, "orientation"_a, "material"_a,
          nb::rv_policy::reference_internal)
      .def(
          "set_material_pair",
          [](World& w, const std::string& a, const std::string& b, double friction,
             double restitution,
             double threshold) { w.set_material_pair(a, b, {friction, restitution, threshold}); },
          "a"_a, "b"_a, "friction"_a, "restitution"_a, "restitution_threshold"_a)
      .def_prop_ro("time", &World::time)
      .def("step", &step, "steps"_a)
      .def("save_state", &save_state)
      .def("load_state", &load_state, "blob"_a)
      .def("next_contact_problem", &next_contact_problem, "robot"_a)
      .def("last_contact_problem", &last_contact_problem, "robot"_a)
      .def("set_profiling", &World::set_profiling, "on"_a)
      .def_prop_ro("stage_times", [](const World& w) { return w.stage_times(); })
      .def("reset_stage_times", &World::reset_stage_times);
}

}  // namespace stickslip::python
