// Contact problems and their solvers. Shapes, defaults and the result type live in
// python/stickslip/contact.py.
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>
#include <stickslip/contact.h>
#include <stickslip/errors.h>

#include "bindings.h"
#include "contact/method_of.h"
#include "scenes/time_methods.h"
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
constexpr Word<SolveStatus> kSolveStatuses[] = {
    {"converged", SolveStatus::kConverged},
    {"not_converged", SolveStatus::kNotConverged},
    {"infeasible", SolveStatus::kInfeasible},
};

std::vector<double> vector_of(const VectorIn& a) { return {a.data(), a.data() + a.size()}; }

ContactProblem problem_of(const VectorIn& delassus, const VectorIn& free_velocity,
                          const VectorIn& friction) {
  return {vector_of(delassus), vector_of(free_velocity), vector_of(friction)};
}

void validate_problem(const VectorIn& delassus, const VectorIn& free_velocity,
                      const VectorIn& friction) {
  problem_of(delassus, free_velocity, friction).validate();
}

/// (impulse, velocity, contact residuals, residual, sweeps, Newton steps, status, history).
nb::tuple solve_problem(const VectorIn& delassus, const VectorIn& free_velocity,
                        const VectorIn& friction, const VectorIn& impulse,
                        const std::string& method, const std::string& law, double tolerance,
                        int max_sweeps, const std::string& single_contact,
                        double single_contact_tolerance, double alpha, double alpha_min,
                        double gamma, const std::string& stop, bool history) {
  SolveOptions o;
  o.method = choice("method", method, kSolveMethods);
  o.law = choice("law", law, kFrictionLaws);
  o.tolerance = tolerance, o.max_sweeps = max_sweeps;
  o.single_contact = choice("single_contact", single_contact, kSingleContactMethods);
  o.single_contact_tolerance = single_contact_tolerance;
  o.alpha = alpha, o.alpha_min = alpha_min, o.gamma = gamma;
  o.stop = choice("stop", stop, kStopTests);
  o.record_history = history;
  const ContactProblem problem = problem_of(delassus, free_velocity, friction);
  const std::vector<double> start = vector_of(impulse);
  SolveResult r;
  {
    nb::gil_scoped_release free_interpreter;
    r = solve(problem, o, start);
  }
  return nb::make_tuple(copy_array(r.impulse), copy_array(r.velocity),
                        copy_array(r.contact_residuals), r.residual, r.sweeps, r.newton_steps,
                        word_for(r.status, kSolveStatuses), copy_array(r.history));
}

ArrayOut problem_residual(const VectorIn& delassus, const VectorIn& free_velocity,
                          const VectorIn& friction, const VectorIn& impulse,
                          const std::string& law) {
  return copy_array(residual(problem_of(delassus, free_velocity, friction), vector_of(impulse),
                             choice("law", law, kFrictionLaws)));
}

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
    kernels.push_back(contact::method_of(method));
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
  m.def("validate_contact_problem", &validate_problem, "delassus"_a, "free_velocity"_a,
        "friction"_a);
  m.def("solve_contact_problem", &solve_problem, "delassus"_a, "free_velocity"_a, "friction"_a,
        "impulse"_a, "method"_a, "law"_a, "tolerance"_a, "max_sweeps"_a, "single_contact"_a,
        "single_contact_tolerance"_a, "alpha"_a, "alpha_min"_a, "gamma"_a, "stop"_a, "history"_a);
  m.def("contact_problem_residual", &problem_residual, "delassus"_a, "free_velocity"_a,
        "friction"_a, "impulse"_a, "law"_a);
  m.def("solve_single_contact", &solve_single, "delassus"_a, "free_velocity"_a, "friction"_a,
        "method"_a, "law"_a, "tolerance"_a);
  m.def("_time_single_contact", &time_single_contact, "delassus"_a, "free_velocity"_a, "friction"_a,
        "methods"_a, "law"_a, "tolerance"_a, "rounds"_a);
}

}  // namespace stickslip::python
