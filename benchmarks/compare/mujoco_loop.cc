#include "benchmarks/compare/mujoco_loop.h"

#include <stdexcept>

#include "benchmarks/compare/mjcf_writer.h"
#include "scenes/anymal.h"

namespace stickslip::benchmarks {
namespace {

long warnings = 0;  // MuJoCo reports bad states through a global hook
void count_warning(const char*) { ++warnings; }

mjModel* compile(const std::string& xml) {
  mjVFS files;
  mj_defaultVFS(&files);
  mj_addBufferVFS(&files, "robot.xml", xml.data(), static_cast<int>(xml.size()));
  char error[1000] = "";
  mjModel* model = mj_loadXML("robot.xml", &files, error, sizeof error);
  mj_deleteVFS(&files);
  if (!model) throw std::runtime_error(std::string("MuJoCo rejects the model: ") + error);
  return model;
}

/// Turns v by the quaternion's rotation (row-major matrix r), or back.
void turn(const Matrix3& r, bool back, const double* v, double* out) {
  for (int i = 0; i < 3; ++i) {
    out[i] = 0;
    for (int k = 0; k < 3; ++k) out[i] += (back ? r[3 * k + i] : r[3 * i + k]) * v[k];
  }
}

}  // namespace

void to_mujoco(const Model& model, std::span<const double> q, std::span<const double> u,
               double* qpos, double* qvel) {
  std::copy(q.begin(), q.end(), qpos);
  std::copy(u.begin(), u.end(), qvel);
  if (model.base() == BaseType::kFloating)
    turn(scenes::rotation_of(q.subspan(3).first<4>()), true, &u[3], qvel + 3);
}

void from_mujoco(const Model& model, const double* qpos, const double* qvel, std::span<double> q,
                 std::span<double> u) {
  std::copy(qpos, qpos + q.size(), q.begin());
  std::copy(qvel, qvel + u.size(), u.begin());
  if (model.base() == BaseType::kFloating)
    turn(scenes::rotation_of(std::span<const double>(q).subspan(3).first<4>()), false, qvel + 3,
         &u[3]);
}

MujocoEngine::MujocoEngine(const Scenario& scenario)
    : scenario_(&scenario),
      model_(compile(write_mjcf(scenario))),
      data_(mj_makeData(model_.get())),
      ruler_(std::make_unique<World>()),
      q_(scenario.model->nq()),
      u_(scenario.model->nu()) {
  mju_user_warning = count_warning;
  if (model_->nq != scenario.model->nq() || model_->nv != scenario.model->nu())
    throw std::runtime_error("MuJoCo sees another tree than Model");
  const int first = scenario.model->nu() - scenario.model->num_joints();
  for (int j = 0; j < scenario.model->num_joints(); ++j) {
    const int id = mj_name2id(model_.get(), mjOBJ_JOINT, joint_name(j).c_str());
    if (model_->jnt_dofadr[id] != first + j)
      throw std::runtime_error("MuJoCo orders the joints in another way than Model");
  }
  if (!scenario.actuated()) model_->opt.disableflags |= mjDSBL_ACTUATION;
  ruler_->add_robot(scenario.model);
}

void MujocoEngine::reset(int episode) {
  mj_resetData(model_.get(), data_.get());
  scenario_->initial_state(episode, q_, u_);
  to_mujoco(*scenario_->model, q_, u_, data_->qpos, data_->qvel);
  warnings = 0;
}

void MujocoEngine::observe(Snapshot& out) const {
  const mjData* d = data_.get();
  out.q.resize(q_.size());
  out.u.resize(u_.size());
  from_mujoco(*scenario_->model, d->qpos, d->qvel, out.q, out.u);
  out.contacts = d->ncon;
  out.pushing = 0;
  for (int i = 0; i < d->ncon; ++i) {
    double force[6];
    mj_contactForce(model_.get(), d, i, force);
    out.pushing += force[0] > Snapshot::kLeastForce;
  }
  out.iterations = 0;
  if (d->nefc)
    for (int i = 0; i < std::clamp(d->nisland, 1, static_cast<int>(mjNISLAND)); ++i)
      out.iterations += d->solver_niter[i];
  out.residual = 0;
  out.failed = warnings > 0;
  warnings = 0;
  out.energy = 0;
  if (scenario_->shows_energy && !out.failed) {
    Robot& robot = ruler_->robot(0);
    robot.set_state(out.q, out.u);
    out.energy = robot.kinetic_energy() + robot.potential_energy();
  }
}

}  // namespace stickslip::benchmarks
