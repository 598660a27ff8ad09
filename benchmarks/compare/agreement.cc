#include "benchmarks/compare/agreement.h"

#include <cmath>

#include "benchmarks/compare/mujoco_loop.h"
#include "scenes/anymal.h"
#include "scenes/normal.h"

namespace stickslip::benchmarks {
namespace {

/// Largest |a - b| over largest |a|.
double relative_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double size = 0, difference = 0;
  for (size_t k = 0; k < a.size(); ++k) {
    size = std::fmax(size, std::fabs(a[k]));
    difference = std::fmax(difference, std::fabs(a[k] - b[k]));
  }
  return difference / size;
}

void random_state(const Model& model, int sample, std::vector<double>& q, std::vector<double>& u) {
  std::uint64_t k = 1000 * sample;
  for (double& x : q) x = scenes::normal(k++);
  for (double& x : u) x = 3 * scenes::normal(k++);
  if (model.base() != BaseType::kFloating) return;
  const double norm = std::sqrt(q[3] * q[3] + q[4] * q[4] + q[5] * q[5] + q[6] * q[6]);
  for (int i = 3; i < 7; ++i) q[i] /= norm;
}

/// Force or velocity on a free joint, body axes to world axes.
void base_to_world(const Model& model, const std::vector<double>& q, std::vector<double>& v) {
  if (model.base() != BaseType::kFloating) return;
  const Matrix3 r = scenes::rotation_of(std::span<const double>(q).subspan(3).first<4>());
  const Vector3 w{v[3], v[4], v[5]};
  for (int i = 0; i < 3; ++i)
    v[3 + i] = r[3 * i] * w[0] + r[3 * i + 1] * w[1] + r[3 * i + 2] * w[2];
}

}  // namespace

double model_disagreement(const Scenario& scenario) {
  const Model& model = *scenario.model;
  const int nq = model.nq(), nu = model.nu();
  World world;
  Robot& robot = world.add_robot(scenario.model);
  MujocoEngine mujoco(scenario);
  mjModel* m = mujoco.model();
  mjData* d = mujoco.data();
  m->opt.disableflags |= mjDSBL_CONTACT | mjDSBL_ACTUATION;
  std::vector<double> q(nq), u(nu), ours(nu * nu), theirs(nu * nu), bias(nu), column(nu), unit(nu);
  double worst = 0;
  for (int sample = 0; sample < 5; ++sample) {
    random_state(model, sample, q, u);
    robot.set_state(q, u);
    to_mujoco(model, q, u, d->qpos, d->qvel);
    mj_forward(m, d);

    robot.bias_force(bias);
    column.assign(d->qfrc_bias, d->qfrc_bias + nu);
    base_to_world(model, q, column);
    worst = std::fmax(worst, relative_difference(bias, column));

    // Columns of M in world axes: a unit velocity there, its momentum back to world axes.
    robot.mass_matrix(ours);
    std::vector<double> velocity(nu);
    for (int k = 0; k < nu; ++k) {
      unit.assign(nu, 0);
      unit[k] = 1;
      std::vector<double> position(nq);
      to_mujoco(model, q, unit, position.data(), velocity.data());
      mj_mulM(m, d, column.data(), velocity.data());
      base_to_world(model, q, column);
      for (int i = 0; i < nu; ++i) theirs[i * nu + k] = column[i];
    }
    worst = std::fmax(worst, relative_difference(ours, theirs));
  }
  return worst;
}

}  // namespace stickslip::benchmarks
