// The public World: robots, ground, materials; a step is every robot's step.
#include <stickslip/errors.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "solvers/validate.h"
#include "world/snapshot.h"
#include "world/world_impl.h"

namespace stickslip {
namespace {

[[noreturn]] void reject(const std::string& what) { throw ModelError(what); }

/// The problem of the last step, dense; empty without contacts.
ContactProblem explicit_problem(const step::ContactStage<double>& contacts) {
  ContactProblem p;
  const size_t n = contacts.count();
  if (n == 0) return p;  // the factored problem may be an older step's
  p.delassus.resize(9 * n * n);
  p.free_velocity.resize(3 * n);
  p.friction.resize(n);
  std::vector<double> lambda(3 * n);
  contact::write_out(contacts.problem(), p.delassus.data(), p.free_velocity.data(),
                     p.friction.data(), lambda.data());
  return p;
}

std::pair<std::string, std::string> ordered(const std::string& a, const std::string& b) {
  return a < b ? std::pair{a, b} : std::pair{b, a};
}

}  // namespace

void WorldOptions::validate() const {
  if (!(time_step > 0) || !std::isfinite(time_step))
    reject("time_step must be positive and finite, got " + std::to_string(time_step));
  for (double g : gravity)
    if (!std::isfinite(g)) reject("gravity must be finite");
  if (max_substeps < 1)
    reject("max_substeps must be at least 1, got " + std::to_string(max_substeps));
  const StepSolverOptions& s = solver;
  solvers::check_settings("WorldOptions.solver", solvers::settings_of(s));
  if (s.tolerance == 0) reject("WorldOptions.solver.tolerance is 0; it must be positive [m/s]");
  if (s.method != SolveMethod::kAuto && s.method != SolveMethod::kPerContact &&
      s.method != SolveMethod::kPgs)
    reject(
        "WorldOptions.solver.method: a step solves by kAuto, kPerContact or kPgs; use solve() for "
        "the others");
}

World::Impl::Impl(const WorldOptions& o)
    : options(o),
      settings(world::step_settings(o)),
      gravity{o.gravity[0], o.gravity[1], o.gravity[2]} {
  settings.stages = stages;
}

MaterialPair World::Impl::pair(const std::string& a, const std::string& b) const {
  const auto found = pairs.find(ordered(a, b));
  return found == pairs.end() ? MaterialPair{} : found->second;
}

void World::Impl::refresh_laws() {
  for (int r = 0; r < static_cast<int>(robots.size()); ++r) {
    world::RobotData& d = data(r);
    for (int k = 0; k < d.scene.tables().num_shapes; ++k) {
      const std::string& own = d.model->shapes()[d.scene.shapes()[k].shape].material;
      d.scene.set_law(k, pair(own.empty() ? d.material : own, ground_material));
    }
  }
}

World::World(const WorldOptions& options) {
  options.validate();
  impl_ = std::make_unique<Impl>(options);
}
World::~World() = default;
World::World(World&&) noexcept = default;
World& World::operator=(World&&) noexcept = default;

void World::add_ground(double height, const std::string& material) {
  if (impl_->settings.ground) reject("add_ground: the world has a ground already");
  if (!std::isfinite(height)) reject("add_ground: height is not finite");
  impl_->settings.ground = true;
  impl_->settings.ground_height = height;
  impl_->ground_material = material;
  impl_->refresh_laws();
}

Robot& World::add_robot(ModelPtr model, const RobotOptions& given) {
  if (!model) reject("add_robot: the model is null");
  RobotOptions o = given;
  double norm = 0;
  for (double x : o.orientation) norm += x * x;
  norm = std::sqrt(norm);
  if (!(norm > 1e-6) || !std::isfinite(norm))
    reject("add_robot: orientation must be a quaternion (w, x, y, z) that is not zero");
  for (double& x : o.orientation) x /= norm;
  for (double x : o.position)
    if (!std::isfinite(x)) reject("add_robot: position is not finite");
  std::set<std::string> names;
  for (const auto& r : impl_->robots) names.insert(r->name());
  if (!o.name.empty() && names.count(o.name))
    reject("add_robot: the world has a robot named '" + o.name + "' already");
  if (o.name.empty()) {
    o.name = model->name();
    for (int k = 2; names.count(o.name); ++k) o.name = model->name() + "_" + std::to_string(k);
  }
  auto robot_impl = std::make_unique<Robot::Impl>(model, o, impl_->options.solver);
  robot_impl->gravity = impl_->gravity;
  robot_impl->index = num_robots();
  robot_impl->contacts.reserve(robot_impl->data.scene.tables().num_points);
  robot_impl->data.state.time = impl_->time;
  impl_->robots.push_back(std::unique_ptr<Robot>(new Robot(std::move(robot_impl))));
  impl_->refresh_laws();
  return *impl_->robots.back();
}

void World::set_material_pair(const std::string& a, const std::string& b, const MaterialPair& p) {
  const std::string where = "set_material_pair('" + a + "', '" + b + "'): ";
  if (!(p.friction >= 0) || std::isnan(p.friction)) reject(where + "friction must be >= 0");
  if (!(p.restitution >= 0 && p.restitution <= 1)) reject(where + "restitution must be in [0, 1]");
  if (!(p.restitution_threshold >= 0)) reject(where + "restitution_threshold must be >= 0");
  impl_->pairs[ordered(a, b)] = p;
  impl_->refresh_laws();
}

int World::num_robots() const { return static_cast<int>(impl_->robots.size()); }

Robot& World::robot(int index) {
  if (index < 0 || index >= num_robots())
    reject("robot " + std::to_string(index) + " does not exist; the world has " +
           std::to_string(num_robots()));
  return *impl_->robots[index];
}
const Robot& World::robot(int index) const { return const_cast<World*>(this)->robot(index); }

double World::time() const { return impl_->time; }
const WorldOptions& World::options() const { return impl_->options; }

StepStatus World::step(int steps) {
  if (steps < 0) reject("step: the number of steps must be >= 0, got " + std::to_string(steps));
  std::uint32_t status = 0;
  for (int k = 0; k < steps; ++k) {
    for (auto& robot : impl_->robots) {
      world::RobotData& d = robot->impl_->data;
      d.step(impl_->settings, impl_->gravity);
      status |= static_cast<std::uint32_t>(d.info.status);
    }
    impl_->time += impl_->options.time_step;
    if (impl_->settings.clock) ++impl_->profiled_steps;
  }
  return static_cast<StepStatus>(status);
}

std::vector<std::uint8_t> World::save_state() const {
  std::vector<const world::RobotData*> robots;
  for (const auto& r : impl_->robots) robots.push_back(&r->impl_->data);
  return world::write_snapshot(impl_->time, robots);
}

void World::load_state(std::span<const std::uint8_t> blob) {
  std::vector<const world::RobotData*> robots;
  for (const auto& r : impl_->robots) robots.push_back(&r->impl_->data);
  world::Snapshot snapshot = world::read_snapshot(blob, robots);  // throws before anything changes
  impl_->time = snapshot.time;
  for (size_t k = 0; k < snapshot.robots.size(); ++k) {
    world::RobotData& d = impl_->robots[k]->impl_->data;
    d.state = snapshot.robots[k];
    d.forget_step();
  }
}

ContactProblem World::next_contact_problem(int index) {
  Robot& r = robot(index);
  world::RobotData& d = r.impl_->data;
  const world::RobotState before = d.state;
  const StepInfo info = d.info;
  d.step(impl_->settings, impl_->gravity);
  ContactProblem p = explicit_problem(d.contacts());
  d.state = before;
  d.info = info;
  d.forget_step();
  return p;
}

ContactProblem World::last_contact_problem(int index, std::vector<double>* impulse) const {
  const step::ContactStage<double>& contacts = robot(index).impl_->data.contacts();
  if (impulse) {
    impulse->clear();
    for (int i = 0; i < contacts.count(); ++i)
      impulse->insert(impulse->end(), contacts.impulse(i), contacts.impulse(i) + 3);
  }
  return explicit_problem(contacts);
}

void World::set_profiling(bool on) { impl_->settings.clock = on ? world::clock_seconds : nullptr; }
const StageTimes& World::stage_times() const {
  const double* t = impl_->stages;
  impl_->times = {t[step::kDynamics], t[step::kDetection], t[step::kDelassus],
                  t[step::kSolve],    t[step::kIntegrate], impl_->profiled_steps};
  return impl_->times;
}
void World::reset_stage_times() {
  std::fill(std::begin(impl_->stages), std::end(impl_->stages), 0.0);
  impl_->profiled_steps = 0;
}

}  // namespace stickslip
