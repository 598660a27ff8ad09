#include "world/snapshot.h"

#include <stickslip/errors.h>

#include <cmath>
#include <cstring>

namespace stickslip::world {
namespace {

constexpr std::uint64_t kMagic = 0x33304c5053535453;  // "STSSPL03"

class Writer {
 public:
  void number(double x) { bytes(&x, sizeof x); }
  void count(std::uint64_t n) { bytes(&n, sizeof n); }
  void numbers(const std::vector<double>& v) {
    count(v.size());
    bytes(v.data(), v.size() * sizeof(double));
  }
  void text(const std::string& t) {
    count(t.size());
    bytes(t.data(), t.size());
  }
  std::vector<std::uint8_t> take() { return std::move(out_); }

 private:
  void bytes(const void* p, size_t n) {
    const auto* b = static_cast<const std::uint8_t*>(p);
    out_.insert(out_.end(), b, b + n);
  }
  std::vector<std::uint8_t> out_;
};

class Reader {
 public:
  explicit Reader(std::span<const std::uint8_t> in) : in_(in) {}
  double number() {
    double x;
    bytes(&x, sizeof x);
    if (!std::isfinite(x))
      throw ModelError("load_state: the state holds a number that is not finite");
    return x;
  }
  std::uint64_t count() {
    std::uint64_t n;
    bytes(&n, sizeof n);
    return n;
  }
  void numbers(std::vector<double>& out, size_t expected) {
    const std::uint64_t n = count();
    if (n != expected)
      throw ModelError("load_state: the state is of another world (expected " +
                       std::to_string(expected) + " numbers, found " + std::to_string(n) + ")");
    out.resize(n);
    for (double& x : out) x = number();
  }
  std::string text() {
    const std::uint64_t n = count();
    if (n > in_.size()) throw ModelError("load_state: the state is cut short");
    std::string t(n, ' ');
    bytes(t.data(), n);
    return t;
  }
  bool done() const { return in_.empty(); }

 private:
  void bytes(void* p, size_t n) {
    if (in_.size() < n) throw ModelError("load_state: the state is cut short");
    std::memcpy(p, in_.data(), n);
    in_ = in_.subspan(n);
  }
  std::span<const std::uint8_t> in_;
};

void check_quaternion(const RobotData& robot, const RobotState& s) {
  if (!robot.floating()) return;
  const double* p = s.q.data() + 3;
  const double square = p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + p[3] * p[3];
  if (std::fabs(square - 1) > 1e-9)
    throw ModelError("load_state: the base quaternion of '" + robot.name +
                     "' is not of unit length");
}

}  // namespace

std::vector<std::uint8_t> write_snapshot(double time, const std::vector<const RobotData*>& robots) {
  Writer w;
  w.count(kMagic);
  w.number(time);
  w.count(robots.size());
  for (const RobotData* robot : robots) {
    const RobotState& s = robot->state;
    w.text(robot->name + "/" + robot->model->name());
    for (const auto* v : {&s.q, &s.u, &s.impulse, &s.earlier_impulse, &s.drift_acceleration})
      w.numbers(*v);
    w.number(s.time);
    w.number(s.pending_gravity);
    w.count(s.fresh);
  }
  return w.take();
}

Snapshot read_snapshot(std::span<const std::uint8_t> blob,
                       const std::vector<const RobotData*>& robots) {
  Reader r(blob);
  if (r.count() != kMagic) throw ModelError("load_state: these bytes are not a saved state");
  Snapshot out;
  out.time = r.number();
  if (const std::uint64_t n = r.count(); n != robots.size())
    throw ModelError("load_state: the state is of a world with " + std::to_string(n) +
                     " robots, this one has " + std::to_string(robots.size()));
  for (const RobotData* robot : robots) {
    const std::string name = robot->name + "/" + robot->model->name(), found = r.text();
    if (found != name)
      throw ModelError("load_state: the state is of robot '" + found + "', this world has '" +
                       name + "' there");
    RobotState s;
    r.numbers(s.q, robot->state.q.size());
    r.numbers(s.u, robot->state.u.size());
    r.numbers(s.impulse, robot->state.impulse.size());
    r.numbers(s.earlier_impulse, robot->state.earlier_impulse.size());
    r.numbers(s.drift_acceleration, robot->state.drift_acceleration.size());
    check_quaternion(*robot, s);
    s.time = r.number();
    s.pending_gravity = r.number();
    const std::uint64_t fresh = r.count();
    if (fresh > 1) throw ModelError("load_state: these bytes are not a saved state");
    s.fresh = fresh == 1;
    out.robots.push_back(std::move(s));
  }
  if (!r.done()) throw ModelError("load_state: bytes are left over after the state");
  return out;
}

}  // namespace stickslip::world
