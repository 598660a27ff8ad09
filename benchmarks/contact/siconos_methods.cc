// Siconos' solvers of the reduced problem (fc3d_driver). Its order is normal first.
#include "benchmarks/contact/method.h"

#ifdef STICKSLIP_SICONOS
#include <FrictionContactProblem.h>
#include <Friction_cst.h>
#include <NonSmoothDrivers.h>
#include <NumericsMatrix.h>
#include <NumericsVerbose.h>
#include <SolverOptions.h>

#include <cstdio>

namespace stickslip::benchmarks {
namespace {

/// Row of ours that is row k of Siconos'.
int ours(int k) { return k % 3 == 0 ? k + 2 : k - 1; }

class Siconos : public Method {
 public:
  Siconos(std::string solver, int id, double tolerance, int iterations)
      : Method(std::move(solver), setting_name(tolerance, iterations)),
        options_(solver_options_create(id)) {
    numerics_set_verbose(0);
    options_->dparam[SICONOS_DPARAM_TOL] = tolerance;
    options_->iparam[SICONOS_IPARAM_MAX_ITER] = iterations;
  }
  ~Siconos() override { solver_options_delete(options_); }
  void prepare(const ContactProblem& problem) override {
    const int m = 3 * problem.num_contacts();
    matrix_.resize(m * m), q_.resize(m), mu_ = problem.friction;
    for (int j = 0; j < m; ++j) {
      q_[j] = problem.free_velocity[ours(j)];
      for (int i = 0; i < m; ++i)  // by columns
        matrix_[j * m + i] = problem.delassus[ours(i) * m + ours(j)];
    }
    reaction_.assign(m, 0), velocity_.assign(m, 0);
  }
  void solve() override {
    const int m = static_cast<int>(q_.size());
    NumericsMatrix* matrix = NM_create_from_data(NM_DENSE, m, m, matrix_.data());
    FrictionContactProblem problem = {3, m / 3, matrix, q_.data(), mu_.data()};
    fc3d_driver(&problem, reaction_.data(), velocity_.data(), options_);
    matrix->matrix0 = nullptr;  // the data are ours
    NM_clear(matrix);
    free(matrix);
  }
  std::vector<double> impulse() const override {
    std::vector<double> out(reaction_.size());
    for (int k = 0; k < static_cast<int>(out.size()); ++k) out[ours(k)] = reaction_[k];
    return out;
  }

 private:
  static std::string setting_name(double tolerance, int iterations) {
    char text[64];
    std::snprintf(text, sizeof text, "tol %.0e, %d", tolerance, iterations);
    return text;
  }
  SolverOptions* options_;
  std::vector<double> matrix_, q_, mu_, reaction_, velocity_;
};

}  // namespace

Methods siconos_methods() {
  Methods out;
  const auto add = [&](const char* name, int id, double tolerance, int iterations) {
    out.push_back(std::make_unique<Siconos>(name, id, tolerance, iterations));
  };
  for (const double tolerance : {1e-8, 1e-10}) {
    add("siconos nsgs", SICONOS_FRICTION_3D_NSGS, tolerance, 1000);
    add("siconos nsn_ac", SICONOS_FRICTION_3D_NSN_AC, tolerance, 200);
    add("siconos admm", SICONOS_FRICTION_3D_ADMM, tolerance, 5000);
  }
  for (const double tolerance : {1e-10, 1e-12})
    add("siconos prox", SICONOS_FRICTION_3D_PROX, tolerance, 1000);
  return out;
}

}  // namespace stickslip::benchmarks

#else

namespace stickslip::benchmarks {
Methods siconos_methods() { return {}; }
}  // namespace stickslip::benchmarks

#endif
