#include <cstdio>

#include "benchmarks/contact/method.h"

namespace stickslip::benchmarks {
namespace {

/// solve() with the tolerance `relative` * max|c|. The time includes its checks of the input and
/// the memory of its result.
class Stickslip : public Method {
 public:
  Stickslip(std::string solver, SolveMethod method, double relative)
      : Method(std::move(solver), setting_name(relative)), relative_(relative) {
    options_.method = method;
  }
  void prepare(const ContactProblem& problem, double scale) override {
    problem_ = problem;
    options_.tolerance = relative_ * scale;
  }
  void solve() override { result_ = stickslip::solve(problem_, options_); }
  std::vector<double> impulse() const override { return result_.impulse; }

 private:
  static std::string setting_name(double relative) {
    char text[32];
    std::snprintf(text, sizeof text, "tol %.0e max|c|", relative);
    return text;
  }
  double relative_;
  SolveOptions options_;
  ContactProblem problem_;
  SolveResult result_;
};

}  // namespace

Methods stickslip_methods() {
  Methods out;
  for (const double relative : {1e-6, 1e-8}) {
    out.push_back(std::make_unique<Stickslip>("stickslip auto", SolveMethod::kAuto, relative));
    out.push_back(
        std::make_unique<Stickslip>("stickslip per_contact", SolveMethod::kPerContact, relative));
    out.push_back(std::make_unique<Stickslip>("stickslip pgs", SolveMethod::kPgs, relative));
  }
  return out;
}

}  // namespace stickslip::benchmarks
