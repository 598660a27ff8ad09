// The public Batch: checks, and the arrays in and out of the engine.
#include <stickslip/batch.h>
#include <stickslip/errors.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "backend/cpu/batch_impl.h"
#include "world/state_check.h"

namespace stickslip {
namespace {

[[noreturn]] void reject(const std::string& what) { throw ModelError("Batch" + what); }

/// The environments' numbers must fit the indices of arrays.
constexpr int kMostEnvs = 1 << 24;

void check_options(const BatchOptions& o) {
  if (o.num_envs < 1 || o.num_envs > kMostEnvs)
    reject(": num_envs is " + std::to_string(o.num_envs) + "; it must be 1 to " +
           std::to_string(kMostEnvs));
  if (o.num_threads < 0 || o.num_threads > 1024)
    reject(": num_threads is " + std::to_string(o.num_threads) +
           "; it must be 0 (one per core) to 1024");
  if (o.regroup_every < 0)
    reject(": regroup_every is " + std::to_string(o.regroup_every) +
           "; it must be 0 (never) or a number of steps");
}

}  // namespace

Batch::Batch(const World& world, const BatchOptions& options) {
  check_options(options);
  const World::Impl& w = *world.impl_;
  if (w.robots.size() != 1)
    reject(w.robots.empty()
               ? std::string(": the world has no robot; add one before making a batch of it")
               : ": the world has " + std::to_string(w.robots.size()) +
                     " robots; robots meet the ground only, so make one batch per robot");
  const SolveMethod method = w.options.solver.method;
  if (method != SolveMethod::kAuto)
    reject(std::string(": the world's method is ") +
           (method == SolveMethod::kPgs ? "\"pgs\"" : "\"per_contact\"") +
           "; a batch solves by \"auto\": make the world with that");
  impl_ = std::make_unique<Impl>(w, options);
}
Batch::~Batch() = default;
Batch::Batch(Batch&&) noexcept = default;
Batch& Batch::operator=(Batch&&) noexcept = default;

const Model& Batch::model() const { return *impl_->model; }
ModelPtr Batch::model_ptr() const { return impl_->model; }
const WorldOptions& Batch::world_options() const { return impl_->world_options; }
int Batch::num_envs() const { return impl_->options.num_envs; }
Precision Batch::precision() const { return impl_->options.precision; }
int Batch::num_threads() const { return impl_->pool.size(); }
const std::string& Batch::instruction_set() const { return impl_->instruction_set; }
int Batch::width() const { return impl_->kernels->width; }
const std::vector<ContactPoint>& Batch::contact_points() const { return impl_->points; }
const std::vector<int>& Batch::contact_shapes() const { return impl_->shapes; }

std::size_t Batch::memory_bytes() const {
  std::size_t sum = impl_->memory.bytes() + impl_->history_block.bytes() +
                    impl_->constants.bytes() + impl_->bodies.bytes() + impl_->grouping.bytes();
  for (const auto& worker : impl_->workers) sum += worker->workspace.bytes();
  return sum;
}

BatchArray Batch::array(BatchField field) { return impl_->array(field); }

StepStatus Batch::step(int steps, bool (*go_on)()) {
  if (steps < 0) reject(".step: the number of steps must be >= 0, got " + std::to_string(steps));
  const Impl::Hold hold(*impl_, "step");
  // About a tenth of a second of one core.
  const int part = go_on ? std::max(1, (1 << 18) / num_envs()) : std::max(1, steps);
  std::uint32_t bits = 0;
  for (int done = 0; done < steps; done += part) {
    if (done > 0 && !go_on()) break;
    bits |= impl_->step(std::min(part, steps - done), done > 0);
  }
  return static_cast<StepStatus>(bits);
}

void Batch::reset(std::span<const std::int64_t> envs, std::span<const double> q,
                  std::span<const double> u) {
  const Impl::Hold hold(*impl_, "reset");
  const std::size_t nq = model().nq(), nu = model().nu(), n = envs.size();
  std::vector<bool> seen(num_envs());
  for (std::size_t k = 0; k < n; ++k) {
    if (envs[k] < 0 || envs[k] >= num_envs())
      reject(".reset: environment " + std::to_string(envs[k]) + " does not exist; there are " +
             std::to_string(num_envs()));
    if (seen[envs[k]])
      reject(".reset: environment " + std::to_string(envs[k]) + " is listed twice");
    seen[envs[k]] = true;
  }
  const auto check_size = [&](const char* name, std::size_t size, std::size_t row) {
    if (size != 0 && size != n * row)
      reject(std::string(".reset: ") + name + " has " + std::to_string(size) + " numbers; " +
             std::to_string(n) + " environments of " + std::to_string(row) + " are wanted");
  };
  check_size("q", q.size(), nq);
  check_size("u", u.size(), nu);
  const auto q_of = [&](std::size_t k) {
    return q.empty() ? impl_->start_q.data() : q.data() + k * nq;
  };
  const auto u_of = [&](std::size_t k) {
    return u.empty() ? impl_->start_u.data() : u.data() + k * nu;
  };
  for (std::size_t k = 0; k < n; ++k)
    if (const std::string fault = world::state_fault(model(), q_of(k), u_of(k)); !fault.empty())
      reject(".reset: row " + std::to_string(k) + ", " + fault);
  for (std::size_t k = 0; k < n; ++k) impl_->reset(envs[k], q_of(k), u_of(k));
}

void Batch::set_profiling(bool on) {
  for (auto& worker : impl_->workers) worker->settings.clock = on ? world::clock_seconds : nullptr;
}

const StageTimes& Batch::stage_times() const {
  StageTimes& t = impl_->times;
  t = StageTimes{};
  for (const auto& worker : impl_->workers) {
    const double* s = worker->stages;
    t.dynamics += s[step::kDynamics];
    t.detection += s[step::kDetection];
    t.delassus += s[step::kDelassus];
    t.solve += s[step::kSolve];
    t.integrate += s[step::kIntegrate];
  }
  t.steps = impl_->profiled_steps;
  return t;
}

void Batch::reset_stage_times() {
  for (auto& worker : impl_->workers)
    std::fill(std::begin(worker->stages), std::end(worker->stages), 0.0);
  impl_->profiled_steps = 0;
}

}  // namespace stickslip
