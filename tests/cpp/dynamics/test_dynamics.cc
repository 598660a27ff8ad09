// The dynamics kernels against each other and across scalars. Pinocchio is the outside oracle
// (tests/python).
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "check.h"
#include "dynamics/contact_rows.h"
#include "dynamics/dynamics.h"
#include "dynamics/mass_matrix.h"
#include "dynamics/random_robots.h"
#include "layout/tree_memory.h"

using namespace stickslip;
using namespace stickslip::dynamics;

namespace {

/// Robots of one model in one random state per lane of S.
template <class S>
struct Robots {
  using W = Wide<S>;
  layout::TreeMemory<S> memory;
  Tree<S>& t;
  std::vector<Slot> slots;
  std::vector<Spatial<W>> wrenches;
  std::vector<S> q, rates, extra, joints;
  S quaternion[4], base[6] = {};
  Vec3<S> w, gravity;

  /// states: one environment per lane of S; entries: quaternion (4), angular velocity (3), q, rates
  Robots(const Model& model, const std::vector<std::vector<double>>& states)
      : memory(model), t(memory.tree()), gravity{S(0), S(0), constant<S>(-9.81)} {
    const int n = model.num_joints();
    slots.assign(t.slots, t.slots + t.num_slots);
    for (Slot& slot : slots) slot.carries = true;
    t.slots = slots.data();
    q.resize(n), rates.resize(n), extra.resize(n), joints.resize(n);
    wrenches.assign(t.num_slots, {{W(3), W(2), W(1)}, {W(6), W(5), W(4)}});
    const auto load = [&](S& to, int k) {
      for (int lane = 0; lane < ScalarTraits<S>::kWidth; ++lane)
        set_lane(to, lane, static_cast<Value<S>>(states[lane][k]));
    };
    for (int k = 0; k < 4; ++k) load(quaternion[k], k);
    load(w.x, 4), load(w.y, 5), load(w.z, 6);
    for (int j = 0; j < n; ++j)
      load(q[j], 7 + j), load(rates[j], 7 + n + j), extra[j] = constant<S>(0.01);
  }

  WalkInput<S> input() const {
    return {quaternion,   q.data(),     w,     w,     rates.data(),   gravity,
            extra.data(), rates.data(), &push, &push, wrenches.data()};
  }
  const Spatial<S> push{{S(1), S(2), S(3)}, {S(4), S(5), S(6)}};  // on the base
};

/// What the kernels make of one random state, for any scalar: everything a step uses, in one list.
template <class S>
std::vector<S> run_kernels(const Model& model, const std::vector<std::vector<double>>& states) {
  Robots<S> r(model, states);
  Tree<S>& t = r.t;
  layout::TreeMemory<S>& memory = r.memory;
  std::vector<S> out;
  compute_positions(t, r.quaternion, r.q.data());
  compute_inertias(t);
  factor_mass_matrix(t, r.extra.data());
  compute_bias(t, r.w, r.rates.data(), r.gravity);
  solve_lower_transposed(t, r.rates.data());
  out.push_back(solve_lower(t, r.base, r.joints.data()));
  out.insert(out.end(), r.base, r.base + 6);
  out.insert(out.end(), r.joints.begin(), r.joints.end());
  compute_velocities(t, r.w, r.rates.data());
  multiply_lower(t, r.w, r.rates.data());
  out.push_back(squared_norm(t));
  const Spatial<S> p = base_momentum(t);
  out.insert(out.end(), {p.ang.x, p.ang.y, p.ang.z, p.lin.x, p.lin.y, p.lin.z});
  std::vector<LinkIndex> path(model.num_joints());
  std::vector<Row3<S>> rows(model.num_joints());
  for (const LinkIndex& link : memory.layout().link_of_body) {
    Row3<S> base[6];
    ContactRows<S> r{0, path.data(), rows.data(), base};
    const S half = constant<S>(0.5), o = constant<S>(0);
    const Vec3<S> point = point_position(t, link, Vec3<S>{half, o, half});
    compute_contact_rows(t, link, point, r);
    for (int k = 0; k < r.depth + 6; ++k) {
      S row[3];
      store(k < r.depth ? r.joint[k] : r.base[k - r.depth], row);
      out.insert(out.end(), row, row + 3);
    }
  }
  std::vector<RigidInertia<Wide<S>>> scratch(t.num_slots);
  std::vector<S> m(model.nu() * model.nu());
  compute_mass_matrix(t, scratch.data(), m.data());
  out.insert(out.end(), m.begin(), m.end());
  return out;
}

std::vector<double> random_state(const Model& model, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> n;
  std::vector<double> s(7 + 2 * model.num_joints());
  for (double& x : s) x = n(rng);
  const double norm = std::sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2] + s[3] * s[3]);
  for (int k = 0; k < 4; ++k) s[k] /= norm;
  return s;
}

std::vector<ModelPtr> robots() {
  using testing::random_robot;
  return {random_robot(1, 12, 4, BaseType::kFloating), random_robot(2, 13, 4, BaseType::kFloating),
          random_robot(3, 15, 0, BaseType::kFloating), random_robot(4, 7, 1, BaseType::kFixed),
          random_robot(5, 20, 0, BaseType::kFixed), random_robot(6, 30, 0, BaseType::kFloating),
          random_robot(7, 1, 1, BaseType::kFixed), random_robot(8, 18, 6, BaseType::kFloating),
          testing::random_humanoid(9), testing::aligned_legs(11, true),
          testing::aligned_legs(12, false),
          // Equal chains of which one carries others; chains of every length around a block.
          testing::random_tree(10, {-1, 0, -1, 2, 1, 4, 1, 6, 7, -1, 9, -1, 11, 12, 13, 14}, true,
                               BaseType::kFloating)};
}

/// All numbers that passes leave in a tree and its links.
template <class S>
std::vector<Value<S>> numbers(Robots<S>& r, bool with_composite) {
  if (!with_composite) r.t.base.composite = {};
  std::vector<Value<S>> out;
  const auto add = [&](const auto& x) {
    const auto* from = reinterpret_cast<const Value<S>*>(&x);
    out.insert(out.end(), from, from + int(sizeof x) / int(sizeof(Value<S>)));
  };
  for (const S& x : r.joints) add(x);
  add(r.base), add(r.t.base);
  for (int slot = 0; slot < r.t.num_slots; ++slot) add(r.t.links[slot]);
  return out;
}

/// Fused passes against the passes alone.
template <class S>
void compare_fused() {
  for (const ModelPtr& model : robots()) {
    std::vector<std::vector<double>> states;
    for (int lane = 0; lane < ScalarTraits<S>::kWidth; ++lane)
      states.push_back(random_state(*model, 20 + lane));
    Robots<S> alone(*model, states), fused(*model, states);
    Tree<S>&a = alone.t, &f = fused.t;
    const WalkInput<S> in = fused.input();

    compute_positions(a, in.quaternion, in.joints);
    compute_inertias(a);
    compute_bias(a, in.angular_velocity, in.rates, in.gravity);
    factor_mass_matrix(a, in.diagonal);
    a.base.force = a.base.force + *in.base_force;
    a.base.force = a.base.force + force_of_wrench(*in.base_wrench, a.base.inertia);
    for (int slot = 0; slot < a.num_slots; ++slot)
      a.links[slot].force =
          a.links[slot].force + force_of_wrench(in.wrenches[slot], a.links[slot].inertia);
    solve_lower_transposed(a, in.tau);
    a.base.force = {}, f.base.force = {};
    compute_free_motion(f, in);
    f.base.force = {};
    CHECK(numbers(alone, false) == numbers(fused, false));

    compute_inertias(a);
    compute_inertias(f);
    compute_velocities(a, in.angular_velocity, in.rates);
    multiply_lower(a, in.linear_velocity, in.rates);
    multiply_lower(f, in.angular_velocity, in.linear_velocity, in.rates);
    CHECK(numbers(alone, true) == numbers(fused, true));

    compute_bias(a, in.angular_velocity, in.joints, in.gravity);
    solve_lower_transposed<S>(a, nullptr);
    solve_bias(f, in.angular_velocity, in.joints, in.gravity);
    CHECK(numbers(alone, true) == numbers(fused, true));

    compute_inertias(a);
    factor_mass_matrix(a, in.diagonal);
    compute_bias(a, in.angular_velocity, in.rates, in.gravity);
    solve_lower_transposed<S>(a, nullptr);
    factor_and_solve_bias(f, in.diagonal, in.angular_velocity, in.rates, in.gravity);
    const S norm = squared_norm(a), same = solve_lower(f, fused.base, fused.joints.data());
    solve_lower(a, alone.base, alone.joints.data());
    CHECK(numbers(alone, true) == numbers(fused, true));
    for (int lane = 0; lane < ScalarTraits<S>::kWidth; ++lane)
      CHECK(get_lane(norm, lane) == get_lane(same, lane));
  }
}

/// A walk that keeps poses and velocities of links that carry something only, against one that
/// keeps all.
template <class S>
void compare_lean() {
  int left_out = 0;
  for (const ModelPtr& model : robots()) {
    std::vector<std::vector<double>> states;
    for (int lane = 0; lane < ScalarTraits<S>::kWidth; ++lane)
      states.push_back(random_state(*model, 50 + lane));
    Robots<S> whole(*model, states), lean(*model, states);
    const layout::TreeLayout& layout = lean.memory.layout();
    const auto spoil = [](auto& x) {
      auto* number = reinterpret_cast<Value<S>*>(&x);
      std::fill_n(number, sizeof x / sizeof *number, Value<S>(NAN));
    };
    for (int slot = 0; slot < lean.t.num_slots; ++slot) {
      lean.slots[slot].carries = layout.slots[slot].carries;
      LinkState<Wide<S>>& link = lean.t.links[slot];
      spoil(link.rotation), spoil(link.position), spoil(link.velocity);
    }
    compute_free_motion(whole.t, whole.input());
    compute_free_motion(lean.t, lean.input());
    for (int slot = 0; slot < lean.t.num_slots; ++slot) {
      LinkState<Wide<S>>&from = whole.t.links[slot], &to = lean.t.links[slot];
      if (!std::isnan(get_lane(to.position.x, 0))) continue;
      CHECK(!layout.slots[slot].carries);
      to.rotation = from.rotation, to.position = from.position, to.velocity = from.velocity;
      ++left_out;
    }
    CHECK(numbers(whole, true) == numbers(lean, true));
  }
  CHECK((left_out > 0) == (Tree<S>::kLanes == 1));  // a world keeps all
}

/// Puts the mass properties of one lane (environment or branch) into `to`.
template <class W>
void set_inertia(LinkInertia<W>& to, int lane, const LinkInertia<double>& from) {
  constexpr int kNumbers = sizeof(from) / sizeof(double);
  for (int k = 0; k < kNumbers; ++k)
    set_lane(reinterpret_cast<W*>(&to)[k], lane,
             static_cast<Value<W>>(reinterpret_cast<const double*>(&from)[k]));
}

/// A robot whose links' inertias come from the environment, against a model that has them.
template <class S>
void compare_inertias() {
  using testing::random_robot;
  for (const int legs : {0, 4}) {
    const ModelPtr wanted = random_robot(1, 13, legs, BaseType::kFloating);
    const std::vector<std::vector<double>> states(ScalarTraits<S>::kWidth,
                                                  random_state(*wanted, 30));
    Robots<S> expected(*wanted, states), given(*wanted, states);
    // Constants of another robot, overridden.
    std::vector<LinkConstants<WideConstant<S>>> wrong(given.t.constants,
                                                      given.t.constants + given.t.num_slots);
    for (auto& c : wrong) c.inertial = {};
    given.t.constants = wrong.data();
    std::vector<LinkInertia<Wide<S>>> inertias(given.t.num_slots);
    const layout::TreeLayout& layout = given.memory.layout();
    for (int slot = 0; slot < given.t.num_slots; ++slot)
      for (int lane = 0; lane < ScalarTraits<Wide<S>>::kWidth; ++lane) {
        const int body = layout.slots[slot].joint[Tree<S>::kLanes == 1 ? 0 : lane] + 1;
        set_inertia(inertias[slot], lane,
                    layout.turned_inertia(body, wanted->bodies()[body].inertial));
      }
    given.t.inertias = inertias.data();
    compute_free_motion(expected.t, expected.input());
    compute_free_motion(given.t, given.input());
    CHECK(numbers(expected, true) == numbers(given, true));
  }
}

/// Rotations that only rename axes, against the product with them.
template <class S>
void compare_renamings() {
  for (const bool alike : {true, false}) {
    const ModelPtr model = testing::aligned_legs(4, alike);
    const std::vector<std::vector<double>> states(ScalarTraits<S>::kWidth,
                                                  random_state(*model, 31));
    Robots<S> renamed(*model, states), multiplied(*model, states);
    std::vector<Slot> slots(multiplied.t.slots, multiplied.t.slots + multiplied.t.num_slots);
    int count[3] = {};
    for (Slot& slot : slots) {
      if (slot.renaming >= 0) ++count[slot.renaming];
      slot.renaming = -1;
    }
    multiplied.t.slots = slots.data();
    compute_free_motion(renamed.t, renamed.input());
    compute_free_motion(multiplied.t, multiplied.input());
    CHECK(numbers(renamed, true) == numbers(multiplied, true));
    // Lanes of two kinds: only where all rename in the same way. Never the negative axis.
    const int sum = count[0] + count[1] + count[2];
    if (Tree<S>::kLanes > 1)
      CHECK(sum == (alike ? 6 : 3));
    else
      CHECK(sum == (alike ? 24 : 23));
    if (alike)
      for (const int n : count) CHECK(n > 0);
  }
}

template <class Pack>
void compare_lanes_with_double() {
  for (const ModelPtr& model : robots()) {
    std::vector<std::vector<double>> states;
    for (int lane = 0; lane < ScalarTraits<Pack>::kWidth; ++lane)
      states.push_back(random_state(*model, 10 + lane));
    const auto packed = run_kernels<Pack>(*model, states);
    for (int lane = 0; lane < ScalarTraits<Pack>::kWidth; ++lane) {
      const auto scalar = run_kernels<Value<Pack>>(*model, {states[lane]});
      CHECK(scalar.size() == packed.size());
      int different = 0;
      for (size_t k = 0; k < scalar.size(); ++k)
        different += get_lane(packed[k], lane) != scalar[k];
      CHECK(different == 0);
    }
  }
}

}  // namespace

TEST(RowsOfAPointAreThoseOfALinksMotion) {
  for (const ModelPtr& model : robots()) {
    Robots<double> r(*model, {random_state(*model, 40)});
    compute_free_motion(r.t, r.input());
    std::vector<LinkIndex> path(model->num_joints());
    std::vector<Row3<double>> linear(model->num_joints()), angular(linear), direct(linear);
    Row3<double> bases[3][6];
    ContactRows<double> at_origin{0, path.data(), linear.data(), bases[0]},
        turning{0, path.data(), angular.data(), bases[1]},
        at_tip{0, path.data(), direct.data(), bases[2]};
    for (const LinkIndex& link : r.memory.layout().link_of_body) {
      const Vec3<double> origin = point_position(r.t, link, Vec3<double>{0.1, 0, -0.2}),
                         tip = point_position(r.t, link, Vec3<double>{0.3, -0.4, 0.5});
      compute_contact_rows(r.t, link, origin, at_origin);
      compute_angular_rows(r.t, link, turning);
      compute_contact_rows(r.t, link, tip, at_tip);
      CHECK(turning.depth == at_tip.depth);
      const auto compare = [&](const Row3<double>& v, const Row3<double>& w,
                               const Row3<double>& expected) {
        double row[3], other[3];
        store(at_point(v, w, tip - origin), row);
        store(expected, other);
        for (int k = 0; k < 3; ++k) CHECK_NEAR(row[k], other[k], 1e-11 * (1 + std::fabs(other[k])));
      };
      for (int k = 0; k < at_tip.depth; ++k) compare(linear[k], angular[k], direct[k]);
      for (int k = 0; k < 6 && r.t.floating; ++k) compare(bases[0][k], bases[1][k], bases[2][k]);
    }
  }
}

TEST(AScaleOfTheForcesScalesWhatIsSolved) {
  // A power of two: not a bit is lost.
  constexpr double kScale = 1.0 / 1024;
  for (const ModelPtr& model : robots()) {
    Robots<double> whole(*model, {random_state(*model, 5)}),
        part(*model, {random_state(*model, 5)});
    WalkInput<double> in = whole.input();
    compute_free_motion(whole.t, in);
    in.scale = kScale;
    compute_free_motion(part.t, in);
    for (int k = 0; k < 6; ++k) CHECK(part.t.base.x[k] == kScale * whole.t.base.x[k]);
    for (int slot = 0; slot < whole.t.num_slots; ++slot)
      for (int lane = 0; lane < kMaxLanes; ++lane)
        CHECK(get_lane(part.t.links[slot].x, lane) ==
              kScale * get_lane(whole.t.links[slot].x, lane));
  }
}

TEST(DoublePacksEqualDoubleBitForBit) {
  compare_lanes_with_double<Pack<double, 4>>();
  compare_lanes_with_double<Pack<double, 8>>();
}

TEST(FloatPacksEqualFloatBitForBit) {
  compare_lanes_with_double<Pack<float, 8>>();
  compare_lanes_with_double<Pack<float, 16>>();
}

TEST(FusedPassesEqualSeparateOnesBitForBit) {
  compare_fused<double>();
  compare_fused<float>();
  compare_fused<Pack<double, 4>>();
  compare_fused<Pack<double, 8>>();
  compare_fused<Pack<float, 8>>();
  compare_fused<Pack<float, 16>>();
}

TEST(PosesOfLinksThatCarryNothingAreNotMissed) {
  compare_lean<double>();
  compare_lean<Pack<double, 8>>();
  compare_lean<Pack<float, 16>>();
}

TEST(RenamingAxesEqualsMultiplyingWithTheRotationThatDoes) {
  compare_renamings<double>();
  compare_renamings<float>();
  compare_renamings<Pack<double, 8>>();
  compare_renamings<Pack<float, 16>>();
}

TEST(InertiasPerEnvironmentEqualThoseOfAModelThatHasThem) {
  compare_inertias<double>();
  compare_inertias<Pack<double, 8>>();
  compare_inertias<Pack<float, 16>>();
}

TEST(FloatEqualsDoubleToFloatPrecision) {
  for (const ModelPtr& model : robots()) {
    const auto state = random_state(*model, 3);
    const auto d = run_kernels<double>(*model, {state});
    const auto f = run_kernels<float>(*model, {state});
    double scale = 0;
    for (double x : d) scale = std::max(scale, std::fabs(x));
    for (size_t k = 0; k < d.size(); ++k) CHECK_NEAR(d[k], double(f[k]), 3e-5 * scale);
  }
}

TEST(RotorsFeelNothingOfHowTheirCentripetalForceIsRounded) {
  // A small disk spins fast about its center of mass, far from the base: no torque.
  ModelBuilder builder("rotor");
  const double mass = 0.1, disk = 1e-5, rate = 1000;
  builder.add_link("base", Inertial{1, {0, 0, 0}, {1, 0, 0, 1, 0, 1}});
  builder.add_link("disk", Inertial{mass, {0, 0, 0}, {disk, 0, 0, disk, 0, 2 * disk}});
  LinkJoint joint;
  joint.name = "spin", joint.parent = "base", joint.child = "disk";
  joint.type = LinkJointType::kContinuous;
  joint.axis = {0.48, 0.6, 0.64};
  joint.pose.position = {1, -2, 0.5};
  builder.add_joint(joint);
  const ModelPtr model = builder.build(BaseType::kFloating);
  layout::TreeMemory<double> memory(*model);
  Tree<double>& t = memory.tree();
  const auto state = random_state(*model, 8);
  compute_positions(t, state.data(), state.data() + 7);
  compute_inertias(t);
  compute_bias(t, zero3<double>(), &rate, zero3<double>());
  double torque;
  collect_joint_forces(t, &torque);
  CHECK_NEAR(torque, 0, 1e-15 * disk * rate * rate * 10);  // not of mass * distance^2 * rate^2
}

TEST(FactorReproducesTheMassMatrix) {
  for (const ModelPtr& model : robots()) {
    layout::TreeMemory<double> memory(*model);
    Tree<double>& t = memory.tree();
    const auto s = random_state(*model, 5);
    const int n = model->num_joints(), nu = model->nu(), offset = nu - n;
    compute_positions(t, s.data(), s.data() + 7);
    compute_inertias(t);
    factor_mass_matrix<double>(t, nullptr);
    std::vector<RigidInertia<Wide<double>>> scratch(t.num_slots);
    std::vector<double> m(nu * nu), l(nu * nu), u(nu);
    compute_mass_matrix(t, scratch.data(), m.data());
    for (int j = 0; j < nu; ++j) {  // columns of L
      std::fill(u.begin(), u.end(), 0);
      u[j] = 1;
      const double* b = u.data();
      const Vec3<double> v = offset ? Vec3<double>{b[0], b[1], b[2]} : zero3<double>();
      const Vec3<double> w = offset ? Vec3<double>{b[3], b[4], b[5]} : zero3<double>();
      compute_velocities(t, w, b + offset);
      multiply_lower(t, v, b + offset);
      for (int i = 0; i < offset; ++i) l[i * nu + j] = t.base.x[i];
      for (int i = 0; i < n; ++i) {
        const LinkIndex link = memory.layout().link_of_body[i + 1];
        l[(offset + i) * nu + j] = get_lane(t.links[link.slot].x, link.lane);
      }
      double kinetic = squared_norm(t);
      CHECK_NEAR(kinetic, m[j * nu + j], 1e-12 * m[j * nu + j]);
    }
    double scale = 0;
    for (double x : m) scale = std::max(scale, std::fabs(x));
    for (int i = 0; i < nu; ++i)
      for (int j = 0; j < nu; ++j) {
        double sum = 0;
        for (int k = 0; k < nu; ++k) sum += l[k * nu + i] * l[k * nu + j];
        CHECK_NEAR(sum, m[i * nu + j], 1e-13 * scale);
      }
  }
}

TEST(SolvesInvertTheMassMatrix) {
  for (const ModelPtr& model : robots()) {
    layout::TreeMemory<double> memory(*model);
    Tree<double>& t = memory.tree();
    const auto s = random_state(*model, 6);
    const int n = model->num_joints(), nu = model->nu(), offset = nu - n;
    compute_positions(t, s.data(), s.data() + 7);
    compute_inertias(t);
    factor_mass_matrix<double>(t, nullptr);
    std::vector<RigidInertia<Wide<double>>> scratch(t.num_slots);
    std::vector<double> m(nu * nu), a(nu);
    compute_mass_matrix(t, scratch.data(), m.data());
    t.base.force = {};
    for (int slot = 0; slot < t.num_slots; ++slot) t.links[slot].force = {};
    solve_lower_transposed(t, s.data() + 7);
    double base[6];
    solve_lower(t, base, a.data() + offset);
    for (int k = 0; k < offset; ++k) a[k] = base[k];
    for (int i = 0; i < nu; ++i) {
      double sum = 0, size = 0;
      for (int j = 0; j < nu; ++j)
        sum += m[i * nu + j] * a[j], size += std::fabs(m[i * nu + j] * a[j]);
      CHECK_NEAR(sum, i < offset ? 0 : s[7 + i - offset], 1e-11 * (1 + size));
    }
  }
}
