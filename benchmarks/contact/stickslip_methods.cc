#include <cstdio>

#include "benchmarks/contact/method.h"

namespace stickslip::benchmarks {
namespace {

/// solve() with the tolerance `relative` * max|c|. The time includes its checks of the input and
/// the memory of its result.
class Stickslip : public Method {
 public:
  Stickslip(std::string solver, SolveMethod method, double relative)
      : Method(std::move(solver), setting_name(relative)) {
    options_.method = method;
    options_.tolerance = 0;
    options_.relative_tolerance = relative;
  }
  void prepare(const ContactProblem& problem) override { problem_ = problem; }
  void solve() override { result_ = stickslip::solve(problem_, options_); }
  std::vector<double> impulse() const override { return result_.impulse; }

 private:
  static std::string setting_name(double relative) {
    char text[32];
    std::snprintf(text, sizeof text, "relative tol %.0e", relative);
    return text;
  }
  SolveOptions options_;
  ContactProblem problem_;
  SolveResult result_;
};

}  // namespace

Methods stickslip_methods() {
  Methods out;
  const auto add = [&](const char* name, SolveMethod method, double relative) {
    out.push_back(std::make_unique<Stickslip>(name, method, relative));
  };
  for (const double relative : {1e-6, 1e-8}) {
    add("stickslip auto", SolveMethod::kAuto, relative);
    add("stickslip per_contact", SolveMethod::kPerContact, relative);
  }
  add("stickslip pgs", SolveMethod::kPgs, 1e-8);
  add("stickslip prox_newton", SolveMethod::kProxNewton, 1e-8);
  add("stickslip interior_point", SolveMethod::kInteriorPoint, 1e-8);
  add("stickslip admm", SolveMethod::kAdmm, 1e-8);
  return out;
}

}  // namespace stickslip::benchmarks
