#include "benchmarks/compare/robots.h"

#include <stickslip/world.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>

#include "benchmarks/compare/observer.h"
#include "scenes/normal.h"

namespace stickslip::benchmarks {
namespace {

constexpr std::uint64_t kEpisodeBase = 100'000;  // random numbers set aside per episode

struct Row {
  const char* name;
  const char* urdf;
  BaseType base;
  double episode, settle;  // [s]
  double stiffness;        // largest kp of a joint [N m/rad]
  double rate;     // kp is at most rate^2 times the inertia that the joint sees, so that MuJoCo's
                   // explicit PD is stable [rad/s]
  double damping;  // kd over kp [s]
  double spread;   // of the targets [rad]; 0: hold the posture
  long hold_steps;
  double lowest_base, highest_base;       // see Scenario
  double aim_batch;                       // see Scenario
  const char* aim_group;                  // see Scenario
  std::map<std::string, double> posture;  // joints that are not at zero [rad]
};

const std::vector<Row>& rows() {
  static const std::vector<Row> kRows{
      {"TALOS stands",
       "talos_data/robots/talos_reduced_box.urdf",
       BaseType::kFloating,
       2,
       1,
       1500,
       250,
       0.01,
       0,
       0,
       0.6,
       1.2,
       20,
       "humanoid",
       {{"leg_left_3_joint", -0.4},
        {"leg_left_4_joint", 0.8},
        {"leg_left_5_joint", -0.4},
        {"leg_right_3_joint", -0.4},
        {"leg_right_4_joint", 0.8},
        {"leg_right_5_joint", -0.4}}},
      {"G1 stands",
       "g1_description/urdf/g1_29dof_rev_1_0.urdf",
       BaseType::kFloating,
       2,
       1,
       500,
       250,
       0.01,
       0,
       0,
       0.4,
       0.9,
       20,
       "humanoid",
       {{"left_hip_pitch_joint", -0.3},
        {"left_knee_joint", 0.6},
        {"left_ankle_pitch_joint", -0.3},
        {"right_hip_pitch_joint", -0.3},
        {"right_knee_joint", 0.6},
        {"right_ankle_pitch_joint", -0.3}}},
      {"Allegro hand",
       "allegro_hand_description/urdf/allegro_right_hand.urdf",
       BaseType::kFloating,
       5,
       1,
       3,
       100,
       0.02,
       0.3,
       200,
       -0.1,
       0.5,
       0,
       "",
       {}},
      {"UR5 swings",
       "ur_description/urdf/ur5_robot.urdf",
       BaseType::kFixed,
       5,
       1,
       500,
       100,
       0.05,
       0.7,
       500,
       -1,
       1,
       20,
       "arm",
       {}},
      {"Panda swings",
       "panda_description/urdf/panda.urdf",
       BaseType::kFixed,
       5,
       1,
       300,
       100,
       0.05,
       0.5,
       500,
       -1,
       1,
       20,
       "arm",
       {}},
  };
  return kRows;
}

/// PD gains from the inertia that each joint sees at q: 1 / (M^-1)_jj.
void choose_gains(const Row& row, Robot& robot, Scenario& s) {
  const int nu = robot.model().nu(), joints = robot.model().num_joints(), first = nu - joints;
  std::vector<double> tau(nu, 0.0), rest(nu), pushed(nu);
  robot.forward_dynamics(tau, rest);
  for (int j = 0; j < joints; ++j) {
    tau[first + j] = 1;
    robot.forward_dynamics(tau, pushed);
    tau[first + j] = 0;
    const double inertia = 1 / (pushed[first + j] - rest[first + j]);
    s.kp.push_back(std::min(row.stiffness, inertia * row.rate * row.rate));
    s.kd.push_back(row.damping * s.kp.back());
  }
}

/// Lowest point of all shapes at a state [m].
double lowest(Robot& robot, std::span<const double> q, std::span<const double> u) {
  robot.set_state(q, u);
  double z = 1e9;
  for (const Shape& s : robot.model().shapes())
    z = std::min(z, lowest_point(s, robot.frame_pose(robot.model().bodies()[s.body].name)));
  return z;
}

Scenario make(const Row& row, const std::string& folder) {
  Scenario s;
  s.name = row.name;
  s.model = load_urdf(folder + "/" + row.urdf, row.base);
  s.ground = row.base == BaseType::kFloating;
  s.episode_steps = std::lround(row.episode / kTimeStep);
  s.hold_steps = row.hold_steps;
  s.settle = row.settle;
  s.lowest_base = row.lowest_base;
  s.highest_base = row.highest_base;
  s.aim_batch = row.aim_batch;
  s.aim_batch_variants = false;
  s.aim_group = row.aim_group;
  std::vector<double> posture(s.model->num_joints(), 0.0);
  for (const auto& [joint, angle] : row.posture) posture[s.model->joint_index(joint)] = angle;

  auto ruler = std::make_shared<World>();
  auto measuring = std::make_shared<std::mutex>();  // batches apart can ask at the same time
  Robot& robot = ruler->add_robot(s.model);
  std::vector<double> q(robot.q().begin(), robot.q().end()), u(s.model->nu(), 0.0);
  std::copy(posture.begin(), posture.end(), q.end() - posture.size());
  robot.set_state(q, u);
  choose_gains(row, robot, s);

  s.initial_state = [=](int episode, std::span<double> q, std::span<double> u) {
    std::fill(q.begin(), q.end(), 0.0);
    std::fill(u.begin(), u.end(), 0.0);
    const size_t first = q.size() - posture.size();
    for (size_t j = 0; j < posture.size(); ++j)
      q[first + j] = posture[j] + 0.02 * scenes::normal(kEpisodeBase * episode + j);
    if (first == 0) return;
    q[3] = 1;
    const std::lock_guard lock(*measuring);
    q[2] = 0.02 - lowest(ruler->robot(0), q, u);  // 2 cm above the ground
  };
  s.target = [=, spread = row.spread](int episode, int k, std::span<double> target) {
    const std::uint64_t number = kEpisodeBase * episode + 1000 + k * target.size();
    for (size_t j = 0; j < target.size(); ++j)
      target[j] = posture[j] + (spread > 0 ? spread * scenes::normal(number + j) : 0);
  };
  return s;
}

}  // namespace

std::vector<Scenario> robot_scenarios(const std::string& folder) {
  std::vector<Scenario> out;
  for (const Row& row : rows()) out.push_back(make(row, folder));
  return out;
}

}  // namespace stickslip::benchmarks
