#include "backend/cpu/batch_impl.h"

#include <stickslip/errors.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "world/state_check.h"

namespace stickslip {
namespace {

using backend::PackKernels;

const PackKernels& choose_kernels(const BatchOptions& o) {
  std::string set = o.instruction_set, from = "instruction_set";
  if (set.empty())
    if (const char* wanted = std::getenv("STICKSLIP_ISA"); wanted && *wanted)
      set = wanted, from = "STICKSLIP_ISA";
  const bool single = o.precision == Precision::kFloat32;
  if (const PackKernels* found = backend::find_kernels(set, single, o.width)) return *found;
  if (!set.empty() && !backend::find_kernels(set, single, 0))
    throw ModelError("Batch: " + from + " is '" + set + "'; this machine has " +
                     backend::instruction_sets());
  if (o.width == 0)
    throw ModelError(
        "Batch: this processor has none of the instruction sets it needs (AVX2 and FMA)");
  throw ModelError("Batch: there is no pack of " + std::to_string(o.width) + " environments" +
                   (set.empty() ? "" : " for " + set));
}

std::size_t constants_bytes(const layout::TreeLayout& layout, const PackKernels& kernels) {
  return std::max(1, layout.num_slots) * sizeof(dynamics::LinkConstants<double>) *
         kernels.bundle_lanes;
}

long round_up(long n, long k) { return (n + k - 1) / k * k; }

int thread_count(const BatchOptions& o, long packs) {
  const long wanted =
      o.num_threads > 0 ? o.num_threads : static_cast<long>(backend::usable_cores().size());
  return static_cast<int>(std::clamp(wanted, 1l, o.num_threads > 0 ? wanted : packs));
}

}  // namespace

Batch::Impl::Worker::Worker(const PackKernels& kernels, const backend::PackScene& scene,
                            const StepSolverOptions& solver)
    : host(scene.tables->num_points, solver) {
  workspace = world::AlignedBlock(static_cast<std::size_t>(kernels.workspace_bytes(scene)));
  kernels.prepare(workspace.data(), scene);
}

Batch::Impl::Impl(const World::Impl& world, const BatchOptions& o)
    : options(o),
      world_options(world.options),
      model(world.data(0).model),
      robot_name(world.data(0).name),
      kernels(&choose_kernels(o)),
      instruction_set(kernels->instruction_set),
      layout(*model, kernels->bundle_lanes),
      scene(*model, layout, world.data(0).options),
      pack_scene{},
      history_rows(scene.tables()),
      settings(world.settings),
      padded(round_up(o.num_envs, kernels->width)),
      grouping(o.num_envs, padded, kernels->width, scene.tables().num_points, o.regroup_every),
      memory(scene.tables(), o.precision, o.num_envs, padded),
      bodies(*model, layout, *kernels, grouping, padded),
      pool(thread_count(o, padded / kernels->width), o.pin_threads) {
  settings.clock = nullptr;
  fill_pack_scene();
  fill_parameters(world.data(0), world.gravity);
  const int number = o.precision == Precision::kFloat32 ? 4 : 8;
  history_block =
      world::AlignedBlock(static_cast<std::size_t>(padded) * history_rows.numbers * number);
  fill_start(world.data(0));
  for (int k = 0; k < pool.size(); ++k) {
    workers.push_back(std::make_unique<Worker>(*kernels, pack_scene, world_options.solver));
    Worker& w = *workers.back();
    w.settings = settings;
    w.settings.host = w.host.view();
    w.settings.stages = w.stages;
  }
}

Batch::Impl::Hold::Hold(Impl& batch, const char* what) : batch_(batch) {
  if (batch_.held_.test_and_set())
    throw ModelError(
        std::string("Batch.") + what +
        ": another thread is at work on this batch; a batch belongs to one thread at a time");
}

void Batch::Impl::fill_pack_scene() {
  constants = world::AlignedBlock(constants_bytes(layout, *kernels));
  if (kernels->single)
    layout::write_constants(layout, kernels->bundle_lanes,
                            reinterpret_cast<float*>(constants.data()));
  else
    layout::write_constants(layout, kernels->bundle_lanes,
                            reinterpret_cast<double*>(constants.data()));
  backend::PackScene& p = pack_scene;
  p.tables = &scene.tables();
  p.num_bundles = static_cast<int>(layout.bundles.size());
  p.num_slots = layout.num_slots;
  p.num_joints = layout.num_joints;
  p.bundles = layout.bundles.data();
  p.slots = layout.slots.data();
  p.constants = constants.data();
  p.base_mass = layout.base.mass;
  std::copy(layout.base.center_of_mass.begin(), layout.base.center_of_mass.end(), p.base_com);
  std::copy(layout.base.inertia.begin(), layout.base.inertia.end(), p.base_inertia);
}

void Batch::Impl::fill_parameters(const world::RobotData& robot, const Vec3<double>& gravity) {
  using enum BatchField;
  for (const collide::GroundShape& s : scene.shapes()) {
    scene.set_law(static_cast<int>(shapes.size()),
                  robot.scene.law(static_cast<int>(shapes.size())));
    shapes.push_back(s.shape);
    for (int k = 0; k < s.num_points; ++k) points.push_back({s.body, s.shape, k});
  }
  const world::RobotControl& c = robot.control;
  memory.set_shared_row(kGeneralizedForce, c.generalized_force);
  memory.set_shared_row(kPdTarget, c.target);
  memory.set_shared_row(kKp, c.kp);
  memory.set_shared_row(kKd, c.kd);
  memory.set_shared_row(kFriction, scene.friction());
  memory.set_shared_row(kGravity, std::array{gravity.x, gravity.y, gravity.z});
  std::vector<double> mass, com, inertia;
  for (const Body& body : model->bodies()) {
    const Inertial& i = body.inertial;
    mass.push_back(i.mass);
    com.insert(com.end(), i.center_of_mass.begin(), i.center_of_mass.end());
    inertia.insert(inertia.end(), i.inertia.begin(), i.inertia.end());
  }
  memory.set_shared_row(kBodyMass, mass);
  memory.set_shared_row(kBodyCom, com);
  memory.set_shared_row(kBodyInertia, inertia);
  force = c.force;
  for (const BatchField f : {kQ, kU, kGeneralizedForce, kPdTarget, kContactImpulse, kContactActive,
                             kStatus, kResidual, kTime})
    memory.data(f);
}

void Batch::Impl::fill_start(const world::RobotData& robot) {
  start_q = robot.state.q;
  start_u = robot.state.u;
  for (long env = 0; env < padded; ++env) reset(env, start_q.data(), start_u.data());
}

long Batch::Impl::history_at(long env, int row) const {
  return backend::number_at(grouping.place(env), row, history_rows.numbers, kernels->width);
}
double Batch::Impl::history(long env, int row) const {
  return backend::get_number(history_block.data(), memory.type(BatchField::kQ),
                             history_at(env, row));
}
void Batch::Impl::set_history(long env, int row, double value) {
  backend::set_number(history_block.data(), memory.type(BatchField::kQ), history_at(env, row),
                      value);
}

void Batch::Impl::reset(long env, const double* q, const double* u) {
  using enum BatchField;
  const step::RobotTables& t = scene.tables();
  const double length = world::quaternion_length(*model, q);
  for (int k = 0; k < history_rows.numbers; ++k) set_history(env, k, 0);
  for (int k = 0; k < t.nq; ++k) {
    const double x = t.floating && k >= 3 && k < 7 ? q[k] / length : q[k];
    memory.set(kQ, env, k, x);
    set_history(env, history_rows.q + k, x);
  }
  for (int k = 0; k < t.nu; ++k) {
    memory.set(kU, env, k, u[k]);
    set_history(env, history_rows.u + k, u[k]);
  }
  set_history(env, history_rows.fresh, 1);
  for (long k = 0; k < memory.row(kContactImpulse); ++k) memory.set(kContactImpulse, env, k, 0);
  for (long k = 0; k < memory.row(kContactActive); ++k) memory.set(kContactActive, env, k, 0);
  for (const BatchField f : {kStatus, kResidual, kTime}) memory.set(f, env, 0, 0);
}

BatchArray Batch::Impl::array(BatchField field) {
  using enum BatchField;
  const bool of_bodies = field == kBodyMass || field == kBodyCom || field == kBodyInertia;
  const bool known = of_bodies                    ? bodies.used()
                     : field == kGeneralizedForce ? force
                                                  : memory.has(field);
  if (known) return memory.array(field);
  const Hold hold(*this, "array (first use of a parameter)");  // it allocates
  if (field == kGeneralizedForce) force = true;
  if (of_bodies) bodies.allocate(memory);
  return memory.array(field);
}

backend::EnvArrays Batch::Impl::env_arrays() {
  using enum BatchField;
  const auto parameter = [&](BatchField f, bool optional) -> backend::Parameter {
    if (memory.has(f)) return {memory.data(f), true};
    return {optional ? nullptr : memory.shared_row(f), false};
  };
  backend::EnvArrays a{};
  a.order = grouping.order();
  a.q = memory.data(kQ);
  a.u = memory.data(kU);
  a.generalized_force = memory.data(kGeneralizedForce);
  a.pd_target = memory.data(kPdTarget);
  a.contact_impulse = memory.data(kContactImpulse);
  a.residual = memory.data(kResidual);
  a.contact_active = reinterpret_cast<std::uint8_t*>(memory.data(kContactActive));
  a.status = reinterpret_cast<std::uint32_t*>(memory.data(kStatus));
  a.time = reinterpret_cast<double*>(memory.data(kTime));
  a.kp = parameter(kKp, false);
  a.kd = parameter(kKd, false);
  a.friction = parameter(kFriction, false);
  a.gravity = parameter(kGravity, false);
  a.external_wrench = parameter(kExternalWrench, true);
  a.force = force;
  a.history = history_block.data();
  return a;
}

void Batch::Impl::step_pack(void* self, int thread, long pack) noexcept {
  Impl& b = *static_cast<Impl*>(self);
  Worker& w = *b.workers[thread];
  backend::PackInertias inertias;
  if (b.bodies.used()) {
    b.bodies.refresh(b.memory, pack);
    inertias = {b.bodies.links(pack), b.bodies.base(pack)};
  }
  const std::uint32_t bits =
      b.kernels->step(w.workspace.data(), b.running_, inertias, w.settings, pack * b.kernels->width,
                      b.options.num_envs, b.running_steps_);
  if (bits) b.bits_.fetch_or(bits, std::memory_order_relaxed);
}

void Batch::Impl::regroup_block(void* self, int, long block) noexcept {
  Impl& b = *static_cast<Impl*>(self);
  const auto bodies = b.bodies.carried();
  const backend::LaneRows carried[] = {
      {b.history_block.data(), b.history_rows.numbers,
       static_cast<int>(backend::size_of(b.memory.type(BatchField::kQ)))},
      bodies[0],
      bodies[1]};
  b.grouping.regroup(block, b.running_.contact_active, {carried, b.bodies.used() ? 3u : 1u});
}

std::uint32_t Batch::Impl::step(int steps, bool continues) {
  running_ = env_arrays();
  running_.continues = continues;
  bits_ = 0;
  for (int done = 0; done < steps; done += running_steps_, running_.continues = true) {
    if (grouping.due()) {
      pool.run(grouping.blocks(), {&Impl::regroup_block, this});
      grouping.restart();
    }
    running_steps_ = grouping.part_of(steps - done);
    pool.run(padded / kernels->width, {&Impl::step_pack, this});
    grouping.count(running_steps_);
  }
  if (workers[0]->settings.clock) profiled_steps += static_cast<long>(steps) * options.num_envs;
  return bits_;
}

// ---- saved states: environments follow each other whole, so that a state saved by packs of one
// width is read by packs of another

namespace {

constexpr std::uint64_t kMagic = 0x3230544142535453;  // "STSBAT02"
constexpr BatchField kSaved[] = {BatchField::kQ,
                                 BatchField::kU,
                                 BatchField::kContactImpulse,
                                 BatchField::kContactActive,
                                 BatchField::kStatus,
                                 BatchField::kResidual,
                                 BatchField::kTime};

}  // namespace

std::vector<std::uint64_t> Batch::Impl::signature() const {
  const step::RobotTables& t = scene.tables();
  const auto whole = [](long n) { return static_cast<std::uint64_t>(n); };
  return {kMagic,
          whole(options.num_envs),
          whole(options.precision == Precision::kFloat32 ? 4 : 8),
          whole(t.nq),
          whole(t.nu),
          whole(t.num_points),
          whole(history_rows.numbers)};
}

std::vector<std::uint8_t> Batch::Impl::save() {
  std::vector<std::uint8_t> out;
  const auto add = [&](const void* data, std::size_t bytes) {
    const auto* b = static_cast<const std::uint8_t*>(data);
    out.insert(out.end(), b, b + bytes);
  };
  const std::vector<std::uint64_t> head = signature();
  const std::string name = robot_name + "/" + model->name();
  const std::uint64_t length = name.size();
  add(head.data(), head.size() * sizeof head[0]);
  add(&length, sizeof length);
  add(name.data(), name.size());
  for (const BatchField f : kSaved)
    add(memory.data(f), options.num_envs * memory.row(f) * backend::size_of(memory.type(f)));
  for (long env = 0; env < options.num_envs; ++env)
    for (int k = 0; k < history_rows.numbers; ++k) {
      const double x = history(env, k);
      add(&x, sizeof x);
    }
  return out;
}

void Batch::Impl::load(std::span<const std::uint8_t> blob) {
  const auto refuse = [](const std::string& why) { throw ModelError("Batch.load_state: " + why); };
  const std::vector<std::uint64_t> head = signature();
  const std::string name = robot_name + "/" + model->name();
  std::size_t wanted = (head.size() + 1) * sizeof head[0] + name.size();
  if (blob.size() < sizeof kMagic || std::memcmp(blob.data(), &kMagic, sizeof kMagic) != 0)
    refuse("these bytes are not a saved state of a batch");
  if (blob.size() < wanted) refuse("the state is cut short");
  std::vector<std::uint64_t> found(head.size() + 1);
  std::memcpy(found.data(), blob.data(), found.size() * sizeof found[0]);
  if (found[1] != head[1])
    refuse("the state is of " + std::to_string(found[1]) + " environments, this batch has " +
           std::to_string(head[1]));
  if (found[2] != head[2])
    refuse(std::string("the state is of a batch in ") + (found[2] == 4 ? "float32" : "float64") +
           ", this one has " + (head[2] == 4 ? "float32" : "float64"));
  if (!std::equal(head.begin(), head.end(), found.begin()) || found.back() != name.size() ||
      std::memcmp(blob.data() + found.size() * sizeof found[0], name.data(), name.size()) != 0)
    refuse("the state is of another robot than '" + name + "'");
  const std::size_t start = wanted;
  for (const BatchField f : kSaved)
    wanted += options.num_envs * memory.row(f) * backend::size_of(memory.type(f));
  wanted += sizeof(double) * options.num_envs * history_rows.numbers;
  if (blob.size() != wanted)
    refuse(blob.size() < wanted ? "the state is cut short" : "bytes are left over after the state");
  const std::uint8_t* from = blob.data() + start;
  for (const BatchField f : kSaved) {
    const std::size_t bytes = options.num_envs * memory.row(f) * backend::size_of(memory.type(f));
    std::memcpy(memory.data(f), from, bytes);
    from += bytes;
  }
  for (long env = 0; env < options.num_envs; ++env)
    for (int k = 0; k < history_rows.numbers; ++k, from += sizeof(double)) {
      double x;
      std::memcpy(&x, from, sizeof x);
      set_history(env, k, x);
    }
}

std::vector<std::uint8_t> Batch::save_state() const {
  const Impl::Hold hold(*impl_, "save_state");
  return impl_->save();
}
void Batch::load_state(std::span<const std::uint8_t> blob) {
  const Impl::Hold hold(*impl_, "load_state");
  impl_->load(blob);
}

}  // namespace stickslip
