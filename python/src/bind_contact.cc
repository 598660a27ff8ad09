// Contact problems and their solvers. Shapes, defaults and the result type live in
// python/stickslip/contact.py.
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>
#include <stickslip/contact.h>
#include <stickslip/errors.h>

#include "bindings.h"
#include "scenes/time_methods.h"
#include "solvers/method_of.h"
#include "solvers/solve.h"
#include "words.h"

namespace nb = nanobind;
using namespace nb::literals;

namespace stickslip::python {
namespace {

constexpr Word<StopTest> kStopTests[] = {
    {"residual", StopTest::kResidual},
    {"violation_sum", StopTest::kViolationSum},
    {"update_sum", StopTest::kUpdateSum},
};
constexpr Word<ShiftRule> kShiftRules[] = {
    {"lagged", ShiftRule::kLagged},
    {"damped", ShiftRule::kDamped},
    {"exact", ShiftRule::kExact},
};
constexpr Word<SolveStatus> kSolveStatuses[] = {
    {"converged", SolveStatus::kConverged},
    {"iteration_limit", SolveStatus::kIterationLimit},
    {"stalled", SolveStatus::kStalled},
    {"infeasible", SolveStatus::kInfeasible},
};
constexpr Word<SolveStage> kSolveStages[] = {
    {"start", SolveStage::kStart},
    {"sweeps", SolveStage::kSweeps},
    {"newton", SolveStage::kNewton},
    {"prox_newton", SolveStage::kProxNewton},
    {"interior_point", SolveStage::kInteriorPoint},
    {"admm", SolveStage::kAdmm},
};

std::vector<double> vector_of(const VectorIn& a) { return {a.data(), a.data() + a.size()}; }

/// Whether something given as a word may be used with a law is for the core to say.
SolveOptions options_of(const nb::dict& d) {
  SolveOptions o;
  const auto text = [&d](const char* key) { return nb::cast<std::string>(d[key]); };
  o.method = choice("method", text("method"), kSolveMethods);
  o.law = choice("law", text("law"), kFrictionLaws);
  o.tolerance = nb::cast<double>(d["tolerance"]);
  o.relative_tolerance = nb::cast<double>(d["relative_tolerance"]);
  o.max_sweeps = nb::cast<int>(d["max_sweeps"]);
  o.max_iterations = nb::cast<int>(d["max_iterations"]);
  o.minimum_norm = nb::cast<bool>(d["minimum_norm"]);
  o.proximal_weight = nb::cast<double>(d["proximal_weight"]);
  o.shift = choice("shift", text("shift"), kShiftRules);
  o.single_contact = choice("single_contact", text("single_contact"), kSingleContactMethods);
  o.single_contact_tolerance = nb::cast<double>(d["single_contact_tolerance"]);
  o.alpha = nb::cast<double>(d["alpha"]);
  o.alpha_min = nb::cast<double>(d["alpha_min"]);
  o.gamma = nb::cast<double>(d["gamma"]);
  o.stop = choice("stop", text("stop"), kStopTests);
  o.record_history = nb::cast<bool>(d["history"]);
  return o;
}

nb::dict dict_of(const Certificate& c) {
  nb::dict d;
  d["residuals"] = copy_array(c.residuals);
  d["backward_errors"] = copy_array(c.backward_errors);
  d["residual"] = c.residual;
  d["backward_error"] = c.backward_error;
  d["penetration_speed"] = c.penetration_speed;
  d["cone_violation"] = c.cone_violation;
  d["direction_error"] = c.direction_error;
  d["power"] = c.power;
  return d;
}

nb::dict dict_of(const SolveResult& r) {
  std::vector<double> time, residual;
  nb::list stages;
  for (const HistoryEntry& h : r.history) {
    time.push_back(h.time);
    residual.push_back(h.residual);
    stages.append(word_for(h.stage, kSolveStages));
  }
  nb::dict d, history;
  history["stage"] = stages;
  history["time"] = copy_array(time);
  history["residual"] = copy_array(residual);
  d["impulse"] = copy_array(r.impulse);
  d["velocity"] = copy_array(r.velocity);
  d["certificate"] = dict_of(r.certificate);
  d["stage"] = word_for(r.stage, kSolveStages);
  d["sweeps"] = r.sweeps;
  d["newton_steps"] = r.newton_steps;
  d["interior_point_steps"] = r.interior_point_steps;
  d["admm_iterations"] = r.admm_iterations;
  d["status"] = word_for(r.status, kSolveStatuses);
  d["history"] = history;
  return d;
}

/// A checked problem, kept by the Python object, so that it is copied and checked once.
class CheckedProblem {
 public:
  CheckedProblem(const VectorIn& delassus, const VectorIn& free_velocity, const VectorIn& friction,
                 const std::vector<int>& block_starts, const std::vector<int>& block_columns)
      : problem_{vector_of(delassus), vector_of(free_velocity), vector_of(friction), block_starts,
                 block_columns} {
    problem_.validate();
  }
  nb::dict solve(const VectorIn& impulse, const nb::dict& options) const {
    const SolveOptions o = options_of(options);
    const std::vector<double> start = vector_of(impulse);
    SolveResult r;
    {
      nb::gil_scoped_release free_interpreter;
      r = solvers::solve_checked(problem_, o, start);
    }
    return dict_of(r);
  }
  nb::dict certify(const VectorIn& impulse, const std::string& law) const {
    return dict_of(
        solvers::certify_checked(problem_, vector_of(impulse), choice("law", law, kFrictionLaws)));
  }

 private:
  ContactProblem problem_;
};

/// (impulse (3,), evaluations, converged); delassus (9,), free velocity (3,).
nb::tuple solve_single(const VectorIn& delassus, const VectorIn& free_velocity, double friction,
                       const std::string& method, const std::string& law, double tolerance) {
  SingleContactOptions o;
  o.method = choice("method", method, kSingleContactMethods);
  o.law = choice("law", law, kFrictionLaws);
  o.tolerance = tolerance;
  const SingleContactResult r = solve_contact(delassus.data(), free_velocity.data(), friction, o);
  return nb::make_tuple(copy_array(r.impulse), r.evaluations, r.converged);
}

/// One (ns per solve, evaluations per sliding contact, share of failures) per method; the methods
/// take turns.
nb::list time_single_contact(const VectorIn& delassus, const VectorIn& free_velocity,
                             const VectorIn& friction, const std::vector<std::string>& methods,
                             const std::string& law, double tolerance, int rounds) {
  const bool max_dissipation = choice("law", law, kFrictionLaws) == FrictionLaw::kMaxDissipation;
  std::vector<contact::Method> kernels;
  for (const std::string& m : methods) {
    const SingleContactMethod method = choice("method", m, kSingleContactMethods);
    if (method == SingleContactMethod::kGoldenSection && !max_dissipation)
      throw ModelError("time_single_contact: golden_section has no form for law coulomb");
    kernels.push_back(solvers::method_of(method));
  }
  const std::size_t n = friction.size();
  if (n == 0 || delassus.size() != 9 * n || free_velocity.size() != 3 * n)
    throw ModelError("time_single_contact: shapes (k, 3, 3), (k, 3) and (k,) with k > 0 wanted");
  if (rounds < 1) throw ModelError("time_single_contact: rounds must be at least 1");
  std::vector<scenes::MethodTime> times;
  {
    nb::gil_scoped_release free_interpreter;
    auto contacts =
        scenes::prepare_contacts(delassus.data(), free_velocity.data(), friction.data(), n);
    times = scenes::time_methods(contacts, kernels, max_dissipation, tolerance, rounds);
  }
  nb::list out;
  for (const auto& t : times) out.append(nb::make_tuple(t.ns_per_solve, t.evaluations, t.failures));
  return out;
}

}  // namespace

void bind_contact(nb::module_& m) {
  nb::class_<CheckedProblem>(m, "CheckedProblem")
      .def(nb::init<const VectorIn&, const VectorIn&, const VectorIn&, const std::vector<int>&,
                    const std::vector<int>&>(),
           "delassus"_a, "free_velocity"_a, "friction"_a, "block_starts"_a, "block_columns"_a)
      .def("solve", &CheckedProblem::solve, "impulse"_a, "options"_a)
      .def("certify", &CheckedProblem::certify, "impulse"_a, "law"_a);
  m.def("solve_single_contact", &solve_single, "delassus"_a, "free_velocity"_a, "friction"_a,
        "method"_a, "law"_a, "tolerance"_a);
  m.def("_time_single_contact", &time_single_contact, "delassus"_a, "free_velocity"_a, "friction"_a,
        "methods"_a, "law"_a, "tolerance"_a, "rounds"_a);
}

}  // namespace stickslip::python
