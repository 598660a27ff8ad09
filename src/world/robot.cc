// The public Robot: state and control with checks, and the dynamics quantities at its present
// state.
#include <stickslip/errors.h>

#include <algorithm>
#include <cmath>

#include "dynamics/bias.h"
#include "dynamics/mass_matrix.h"
#include "model/pose.h"
#include "world/robot_impl.h"
#include "world/state_check.h"

namespace stickslip {
namespace {

using dynamics::LinkIndex;

// Names are put together for errors only: setters are called every step and may not allocate.
void check_size(const std::string& owner, const char* what, std::span<const double> values,
                size_t size) {
  if (values.size() != size)
    throw ModelError(owner + what + ": expected " + std::to_string(size) + " numbers, got " +
                     std::to_string(values.size()));
}

void check(const std::string& owner, const char* what, std::span<const double> values,
           size_t size) {
  check_size(owner, what, values, size);
  for (size_t k = 0; k < size; ++k)
    if (!std::isfinite(values[k]))
      throw ModelError(owner + what + "[" + std::to_string(k) + "] is not finite");
}

void check_gains(const std::string& owner, const char* what, std::span<const double> values,
                 size_t size) {
  check(owner, what, values, size);
  for (size_t k = 0; k < size; ++k)
    if (values[k] < 0)
      throw ModelError(owner + what + "[" + std::to_string(k) +
                       "] is negative; gains must be >= 0");
}

void check_output(const char* what, std::span<double> out, size_t size) {
  if (out.size() != size)
    throw ModelError(std::string(what) + ": the output needs room for " + std::to_string(size) +
                     " numbers, has " + std::to_string(out.size()));
}

bool any_nonzero(std::span<const double> values) {
  return std::any_of(values.begin(), values.end(), [](double x) { return x != 0; });
}

}  // namespace

Robot::Impl::Impl(ModelPtr model, const RobotOptions& options, const StepSolverOptions& solver)
    : data(model, options, solver),
      query(*model),
      scratch(query.tree().num_slots),
      velocity(model->nu()) {}

dynamics::Tree<double>& Robot::Impl::tree_at_state() {
  dynamics::Tree<double>& t = query.tree();
  const double* q = data.state.q.data();
  dynamics::compute_positions(t, data.base_quaternion(q), data.joints(q));
  dynamics::compute_inertias(t);
  return t;
}

Robot::Robot(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Robot::~Robot() = default;

const std::string& Robot::name() const { return impl_->data.name; }
const Model& Robot::model() const { return *impl_->data.model; }
ModelPtr Robot::model_ptr() const { return impl_->data.model; }
double Robot::time() const { return impl_->data.state.time; }
std::span<const double> Robot::q() const { return impl_->data.state.q; }
std::span<const double> Robot::u() const { return impl_->data.state.u; }
const StepInfo& Robot::info() const { return impl_->data.info; }
std::span<const double> Robot::generalized_force() const {
  return impl_->data.control.generalized_force;
}
std::span<const double> Robot::pd_kp() const { return impl_->data.control.kp; }
std::span<const double> Robot::pd_kd() const { return impl_->data.control.kd; }
std::span<const double> Robot::pd_target() const { return impl_->data.control.target; }

void Robot::set_state(std::span<const double> q, std::span<const double> u) {
  world::RobotData& d = impl_->data;
  check_size(d.name, ".q", q, d.state.q.size());
  check_size(d.name, ".u", u, d.state.u.size());
  if (const std::string fault = world::state_fault(*d.model, q.data(), u.data()); !fault.empty())
    throw ModelError(d.name + "." + fault);
  const double length = world::quaternion_length(*d.model, q.data());
  world::RobotState& s = d.state;
  std::copy(q.begin(), q.end(), s.q.begin());
  std::copy(u.begin(), u.end(), s.u.begin());
  if (d.floating())
    for (int k = 3; k < 7; ++k) s.q[k] /= length;
  std::fill(s.impulse.begin(), s.impulse.end(), 0.0);
  std::fill(s.earlier_impulse.begin(), s.earlier_impulse.end(), 0.0);
  std::fill(s.drift_acceleration.begin(), s.drift_acceleration.end(), 0.0);
  s.pending_gravity = 0;
  s.fresh = true;
  d.forget_step();
}

void Robot::set_generalized_force(std::span<const double> tau) {
  world::RobotControl& c = impl_->data.control;
  check(name(), ".generalized_force", tau, c.generalized_force.size());
  std::copy(tau.begin(), tau.end(), c.generalized_force.begin());
  c.force = any_nonzero(tau);
}

void Robot::set_pd_gains(std::span<const double> kp, std::span<const double> kd) {
  world::RobotControl& c = impl_->data.control;
  check_gains(name(), ".kp", kp, c.kp.size());
  check_gains(name(), ".kd", kd, c.kd.size());
  if (std::equal(kp.begin(), kp.end(), c.kp.begin()) &&
      std::equal(kd.begin(), kd.end(), c.kd.begin()))
    return;
  std::copy(kp.begin(), kp.end(), c.kp.begin());
  std::copy(kd.begin(), kd.end(), c.kd.begin());
  c.pd = any_nonzero(kp) || any_nonzero(kd);
  const double* own = impl_->data.scene.tables().damping;
  for (size_t j = 0; j < kd.size(); ++j) c.damping[j] = kd[j] + own[j];
  impl_->data.lanes.prepared_step = 0;  // the factor holds the gains
}

void Robot::set_pd_target(std::span<const double> target) {
  world::RobotControl& c = impl_->data.control;
  check(name(), ".pd_target", target, c.target.size());
  std::copy(target.begin(), target.end(), c.target.begin());
}

void Robot::mass_matrix(std::span<double> out) const {
  const int nu = model().nu();
  check_output("mass_matrix", out, nu * nu);
  dynamics::compute_mass_matrix(impl_->tree_at_state(), impl_->scratch.data(), out.data());
}

void Robot::bias_force(std::span<double> out) const {
  world::RobotData& d = impl_->data;
  check_output("bias_force", out, d.state.u.size());
  dynamics::Tree<double>& t = impl_->tree_at_state();
  const double* u = d.state.u.data();
  dynamics::compute_bias(t, d.angular(u), u + d.offset(), impl_->gravity);
  dynamics::collect_joint_forces(t, out.data() + d.offset());
  double base[6];
  dynamics::to_rows(t.base.force, base);
  for (int k = 0; k < d.offset(); ++k) out[k] = base[k];
  for (double& x : out) x = -x;
}

void Robot::forward_dynamics(std::span<const double> tau, std::span<double> out) const {
  world::RobotData& d = impl_->data;
  check("", "tau", tau, d.state.u.size());
  check_output("forward_dynamics", out, d.state.u.size());
  dynamics::Tree<double>& t = impl_->tree_at_state();
  const double* u = d.state.u.data();
  const int offset = d.offset();
  dynamics::factor_mass_matrix<double>(t, nullptr);
  dynamics::compute_bias(t, d.angular(u), u + offset, impl_->gravity);
  if (offset)
    t.base.force =
        t.base.force + Spatial<double>{{tau[3], tau[4], tau[5]}, {tau[0], tau[1], tau[2]}};
  dynamics::solve_lower_transposed(t, tau.data() + offset);
  double base[6];
  dynamics::solve_lower(t, base, out.data() + offset);
  for (int k = 0; k < offset; ++k) out[k] = base[k];
}

void Robot::jacobian(const std::string& frame_name, std::span<double> out) const {
  world::RobotData& d = impl_->data;
  const int nu = model().nu(), offset = d.offset();
  check_output("jacobian", out, 6 * nu);
  const Frame& frame = model().frame(frame_name);
  const dynamics::Tree<double>& t = impl_->tree_at_state();
  const auto& layout = d.memory.layout();
  const Vector3 local = layout.turned(frame.body, frame.pose.position);
  LinkIndex link = layout.link_of_body[frame.body];
  const Vec3<double> p =
      dynamics::point_position(t, link, Vec3<double>{local[0], local[1], local[2]});
  std::fill(out.begin(), out.end(), 0.0);
  const auto put = [&](int column, const Spatial<double>& motion) {
    const Vec3<double> v = cross(motion.ang, p, motion.lin);
    const double rows[6] = {v.x, v.y, v.z, motion.ang.x, motion.ang.y, motion.ang.z};
    for (int r = 0; r < 6; ++r) out[r * nu + column] = rows[r];
  };
  for (; link.slot != dynamics::kBaseSlot; link = t.slots[link.slot].parent[link.lane])
    put(offset + t.slots[link.slot].joint[link.lane],
        dynamics::field_of<double, Spatial>(t, link,
                                            &dynamics::LinkState<dynamics::Wide<double>>::axis));
  for (int k = 0; k < offset; ++k) {
    double unit[6] = {};
    unit[k] = 1;
    put(k, dynamics::from_rows(unit));
  }
}

Pose Robot::frame_pose(const std::string& frame_name) const {
  world::RobotData& d = impl_->data;
  const Frame& frame = model().frame(frame_name);
  const dynamics::Tree<double>& t = impl_->tree_at_state();
  const auto& layout = d.memory.layout();
  const LinkIndex link = layout.link_of_body[frame.body];
  const Vector3 local = layout.turned(frame.body, frame.pose.position);
  const Vec3<double> p =
      dynamics::point_position(t, link, Vec3<double>{local[0], local[1], local[2]}) +
      d.base_position(d.state.q.data());
  Mat3<double> r = t.base.rotation;
  if (link.slot != dynamics::kBaseSlot)
    r = dynamics::field_of<double, Mat3>(t, link,
                                         &dynamics::LinkState<dynamics::Wide<double>>::rotation);
  Matrix3 rotation;
  std::copy(r.m, r.m + 9, rotation.begin());
  rotation = multiply(multiply(rotation, transpose(layout.turn[frame.body])), frame.pose.rotation);
  return {rotation, {p.x, p.y, p.z}};
}

double Robot::kinetic_energy() const {
  impl_->multiply_by_factor(impl_->data.state.u.data());
  return 0.5 * dynamics::squared_norm(impl_->query.tree());
}

double Robot::mechanical_energy() const {
  const world::RobotState& s = impl_->data.state;
  double* velocity = impl_->velocity.data();
  if (s.pending_gravity > 0)
    impl_->gravity_acceleration(velocity);
  else
    std::fill(impl_->velocity.begin(), impl_->velocity.end(), 0.0);
  for (size_t k = 0; k < s.u.size(); ++k)
    velocity[k] = madd(s.pending_gravity, velocity[k], s.u[k]);
  impl_->multiply_by_factor(velocity);
  return 0.5 * dynamics::squared_norm(impl_->query.tree()) + potential_energy();
}

double Robot::potential_energy() const {
  const Vector3 c = center_of_mass();
  const Vec3<double>& g = impl_->gravity;
  return -model().mass() * (g.x * c[0] + g.y * c[1] + g.z * c[2]);
}

Vector3 Robot::center_of_mass() const {
  const RigidInertia<double>& all = impl_->tree_at_state().base.composite;
  const Vec3<double> base = impl_->data.base_position(impl_->data.state.q.data());
  if (!(all.mass > 0)) return {base.x, base.y, base.z};  // a fixed base without moving bodies
  const Vec3<double> c = all.h * (1 / all.mass) + base;
  return {c.x, c.y, c.z};
}

Vector3 Robot::linear_momentum() const {
  const Spatial<double> p = impl_->momentum();
  return {p.lin.x, p.lin.y, p.lin.z};
}

Vector3 Robot::angular_momentum() const {
  const Spatial<double> p = impl_->momentum();
  const RigidInertia<double>& all = impl_->query.tree().base.composite;
  if (!(all.mass > 0)) return {0, 0, 0};
  const Vec3<double> l = p.ang - cross(all.h * (1 / all.mass), p.lin);
  return {l.x, l.y, l.z};
}

void Robot::Impl::gravity_acceleration(double* out) {
  const int offset = data.offset();
  std::fill(out, out + data.state.u.size(), 0.0);
  dynamics::Tree<double>& t = tree_at_state();
  dynamics::factor_mass_matrix<double>(t, nullptr);
  dynamics::compute_bias(t, zero3<double>(), out + offset, gravity);
  dynamics::solve_lower_transposed<double>(t, nullptr);
  double base[6];
  dynamics::solve_lower(t, base, out + offset);
  for (int k = 0; k < offset; ++k) out[k] = base[k];
}

void Robot::Impl::multiply_by_factor(const double* u) {
  dynamics::Tree<double>& t = tree_at_state();
  dynamics::factor_mass_matrix<double>(t, nullptr);
  dynamics::compute_velocities(t, data.angular(u), u + data.offset());
  dynamics::multiply_lower(t, data.linear(u), u + data.offset());
}

Spatial<double> Robot::Impl::momentum() {
  multiply_by_factor(data.state.u.data());
  return dynamics::base_momentum(query.tree());
}

void Robot::delassus(std::span<const int> bodies, std::span<const Vector3> points,
                     std::span<double> out) const {
  world::RobotData& d = impl_->data;
  const size_t n = bodies.size(), nu = d.memory.layout().num_joints + 6;
  if (points.size() != n)
    throw ModelError("delassus: " + std::to_string(n) + " bodies but " +
                     std::to_string(points.size()) + " points");
  check_output("delassus", out, 9 * n * n);
  dynamics::Tree<double>& t = impl_->tree_at_state();
  dynamics::factor_mass_matrix<double>(t, nullptr);
  const Vec3<double> base = d.base_position(d.state.q.data());
  std::vector<double> y(3 * n * nu, 0.0);
  std::vector<LinkIndex> path(d.scene.tables().max_depth + 1);
  std::vector<Row3<double>> joint(d.scene.tables().max_depth + 1);
  for (size_t i = 0; i < n; ++i) {
    if (bodies[i] < 0 || bodies[i] >= static_cast<int>(model().bodies().size()))
      throw ModelError("delassus: bodies[" + std::to_string(i) +
                       "] = " + std::to_string(bodies[i]) + " is not a body of " + name());
    check("delassus: points[" + std::to_string(i) + "]", "", points[i], 3);
    Row3<double> base_rows[6];
    dynamics::ContactRows<double> rows{0, path.data(), joint.data(), base_rows};
    const Vec3<double> p = Vec3<double>{points[i][0], points[i][1], points[i][2]} - base;
    dynamics::compute_contact_rows(t, d.memory.layout().link_of_body[bodies[i]], p, rows);
    const auto put = [&](size_t column, const Row3<double>& value) {
      double v[3];
      store(value, v);
      for (int r = 0; r < 3; ++r) y[(3 * i + r) * nu + column] = v[r];
    };
    if (d.floating())
      for (int k = 0; k < 6; ++k) put(k, rows.base[k]);
    for (int k = 0; k < rows.depth; ++k)
      put(6 + t.slots[path[k].slot].joint[path[k].lane], joint[k]);
  }
  for (size_t a = 0; a < 3 * n; ++a)
    for (size_t b = 0; b < 3 * n; ++b) {
      double sum = 0;
      for (size_t k = 0; k < nu; ++k) sum += y[a * nu + k] * y[b * nu + k];
      out[a * 3 * n + b] = sum;
    }
}

std::span<const Contact> Robot::contacts() const {
  impl_->collect_contacts();
  return {impl_->contacts.data(), impl_->contacts.size()};
}

void Robot::Impl::collect_contacts() {
  const step::ContactStage<double>& stage = data.contacts();
  contacts.clear();
  for (int i = 0; i < stage.count(); ++i) {
    const step::ActiveContact<double>& a = stage.active(i);
    const collide::GroundShape& shape = data.scene.shapes()[a.shape];
    const double* l = stage.impulse(i);
    const Vec3<double> v = stage.velocity_after(i), p = a.position + data.lanes.contact_origin;
    contacts.push_back({index,
                        shape.body,
                        shape.shape,
                        a.point,
                        {p.x, p.y, p.z},
                        {0, 0, 1},
                        a.gap,
                        data.scene.law(a.shape).friction,
                        {l[0], l[1], l[2]},
                        {v.x, v.y, v.z}});
  }
}

}  // namespace stickslip
