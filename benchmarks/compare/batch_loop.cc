#include "benchmarks/compare/batch_loop.h"

#include <numeric>
#include <stdexcept>

#include "benchmarks/compare/stickslip_loop.h"

namespace stickslip::benchmarks {
namespace {

bool has(std::uint32_t status, StepStatus bit) { return status & static_cast<std::uint32_t>(bit); }

/// About the golden section of n and coprime to it: k * stride % n, k = 0, 1, ..., takes all
/// values, and any few in a row lie far apart. So the lanes of a pack are in different phases.
int golden_stride(int n) {
  int stride = std::max(1, static_cast<int>(0.618 * n));
  while (std::gcd(stride, n) != 1) ++stride;
  return stride;
}

}  // namespace

template <class T>
Batch BatchEngine<T>::make(const Scenario& s, const EngineChoice& choice, int num_envs) {
  const World world = make_world(s, choice.integrator);
  BatchOptions options;
  options.num_envs = num_envs;
  options.precision = choice.precision;
  options.num_threads = choice.apart ? 1 : std::max(1, choice.threads);
  options.pin_threads = true;  // those beside the caller's, which OnCores pins
  options.instruction_set = choice.instruction_set;
  if (!choice.regroups) options.regroup_every = 0;
  return Batch(world, options);
}

template <class T>
BatchEngine<T>::BatchEngine(const Scenario& scenario, const EngineChoice& choice, Share share)
    : scenario_(&scenario),
      batch_(make(scenario, choice, share.count)),
      num_envs_(share.count),
      robots_(share.robots),
      nq_(scenario.model->nq()),
      nu_(scenario.model->nu()),
      joints_(scenario.model->num_joints()),
      points_(static_cast<int>(batch_.contact_points().size())),
      stride_(golden_stride(share.robots)),
      q_(data(BatchField::kQ)),
      u_(data(BatchField::kU)),
      impulse_(data(BatchField::kContactImpulse)),
      residual_(data(BatchField::kResidual)),
      targets_(data(BatchField::kPdTarget)),
      active_(static_cast<const std::uint8_t*>(batch_.array(BatchField::kContactActive).data)),
      status_(static_cast<const std::uint32_t*>(batch_.array(BatchField::kStatus).data)),
      clocks_(num_envs_),
      last_(static_cast<size_t>(num_envs_) * joints_),
      next_q_(static_cast<size_t>(num_envs_) * nq_),
      next_u_(static_cast<size_t>(num_envs_) * nu_),
      next_episode_(num_envs_, -1),
      target_(joints_),
      ruler_(std::make_unique<World>()) {
  if (choice.integrator == Integrator::kSemiImplicit)
    opinion_ = std::make_unique<SecondOpinion>(scenario, batch_.contact_points());
  if (scenario.ends_when_still && moving())
    throw std::logic_error("targets of a task that ends when still cannot be laid out");
  ruler_->add_robot(scenario.model);
  finished_.reserve(num_envs_);
  start_q_.resize(next_q_.size());
  start_u_.resize(next_u_.size());
  for (int e = 0; e < num_envs_; ++e) clocks_[e].episode = share.first + e - robots_;

  prepare(scenario.episode_steps);
  NoObserver nobody;
  run(scenario.episode_steps, nobody);
}

template <class T>
void BatchEngine<T>::begin(EpisodeClock& clock) const {
  clock.episode += robots_;
  clock.age = 0;
  clock.still = 0;
  clock.end = scenario_->episode_steps;
  if (clock.episode >= robots_) return;
  const long ticks = clock.end / kTick, phase = clock.episode * long{stride_} % robots_ + 1;
  clock.end = kTick * std::max(1L, ticks * phase / robots_);
}

template <class T>
long BatchEngine<T>::next_event() const {
  if (moving() || scenario_->ends_when_still) return kTick;
  long steps = scenario_->episode_steps;
  for (const EpisodeClock& clock : clocks_) steps = std::min(steps, clock.end - clock.age);
  return steps;
}

template <class T>
void BatchEngine<T>::prepare(long steps) {
  for (int e = 0; e < num_envs_; ++e) lay_out_start(e);
  if (moving()) lay_out_targets(steps);
}

template <class T>
void BatchEngine<T>::lay_out_start(int e) {
  const int episode = clocks_[e].episode + robots_;
  if (next_episode_[e] == episode) return;
  const size_t k = e;
  scenario_->initial_state(episode, {&next_q_[k * nq_], static_cast<size_t>(nq_)},
                           {&next_u_[k * nu_], static_cast<size_t>(nu_)});
  next_episode_[e] = episode;
}

template <class T>
void BatchEngine<T>::lay_out_targets(long steps) {
  std::vector<EpisodeClock> clocks = clocks_;
  script_.clear();
  scripted_ = 0;
  for (long done = 0; done < steps; done += kTick) {
    for (int e = 0; e < num_envs_; ++e) {
      EpisodeClock& clock = clocks[e];
      if (clock.over()) begin(clock);
      if (clock.age % scenario_->hold_steps == 0) {
        scenario_->target(clock.episode, static_cast<int>(clock.age / scenario_->hold_steps),
                          target_);
        std::copy(target_.begin(), target_.end(), &last_[static_cast<size_t>(e) * joints_]);
      }
      clock.age += kTick;
    }
    script_.insert(script_.end(), last_.begin(), last_.end());
  }
}

template <class T>
void BatchEngine<T>::reset_finished() {
  finished_.clear();
  for (int e = 0; e < num_envs_; ++e) {
    EpisodeClock& clock = clocks_[e];
    if (!clock.over()) continue;
    lay_out_start(e);  // done, unless it is its second episode since `prepare`
    begin(clock);
    const size_t k = finished_.size(), from = e;
    std::copy_n(&next_q_[from * nq_], nq_, &start_q_[k * nq_]);
    std::copy_n(&next_u_[from * nu_], nu_, &start_u_[k * nu_]);
    finished_.push_back(e);
    if (moving()) continue;
    scenario_->target(clock.episode, 0, target_);
    std::copy(target_.begin(), target_.end(), targets_ + static_cast<size_t>(e) * joints_);
  }
  if (finished_.empty()) return;
  batch_.reset(finished_, {start_q_.data(), finished_.size() * nq_},
               {start_u_.data(), finished_.size() * nu_});
}

template <class T>
void BatchEngine<T>::find_still() {
  for (int e = 0; e < num_envs_; ++e) {
    T fastest = 0;
    for (int k = 0; k < nu_; ++k) {
      const T rate = std::fabs(u_[static_cast<size_t>(e) * nu_ + k]);
      fastest = rate > fastest ? rate : fastest;
    }
    clocks_[e].still = fastest < static_cast<T>(kStill) ? clocks_[e].still + 1 : 0;
  }
}

template <class T>
void BatchEngine<T>::take(long steps, Observer& observer) {
  for (long k = 1; k <= steps; ++k) {
    const bool sampled = k % kTick == 0;
    if (sampled && opinion_) {
      before_q_.assign(q_, q_ + static_cast<size_t>(num_envs_) * nq_);
      before_u_.assign(u_, u_ + static_cast<size_t>(num_envs_) * nu_);
    }
    batch_.step(1);
    for (int e = 0; e < num_envs_; ++e)
      observer.add_solve(residual_[e], has(status_[e], StepStatus::kNotConverged),
                         has(status_[e], StepStatus::kNonFinite));
    if (!sampled) continue;
    if (opinion_) ask_second_opinion(observer);
    for (int e = 0; e < num_envs_; ++e) {
      const long age = clocks_[e].age + k;
      observer.sample(View{this, e, age}, age);
    }
  }
}

template <class T>
void BatchEngine<T>::ask_second_opinion(Observer& observer) {
  for (int e = 0; e < num_envs_; ++e) {
    const size_t k = e;
    const auto residual =
        opinion_->residual(&before_q_[k * nq_], &before_u_[k * nu_], targets_ + k * joints_,
                           active_ + k * points_, impulse_ + 3 * k * points_);
    observer.add_second_opinion(residual, has(status_[e], StepStatus::kNotConverged));
  }
}

template <class T>
void BatchEngine<T>::observe(int e, long age, Snapshot& out) {
  const T *q = q_ + static_cast<size_t>(e) * nq_, *u = u_ + static_cast<size_t>(e) * nu_;
  out.q.assign(q, q + nq_);
  out.u.assign(u, u + nu_);
  out.contacts = out.pushing = out.iterations = 0;
  for (int p = 0; p < points_; ++p) {
    const size_t k = static_cast<size_t>(e) * points_ + p;
    out.contacts += active_[k] != 0;
    out.pushing += impulse_[3 * k + 2] > Snapshot::kLeastForce * kTimeStep;
  }
  out.energy = 0;
  if (!scenario_->shows_energy ||
      (age != std::lround(scenario_->settle / kTimeStep) && age != scenario_->episode_steps))
    return;
  Robot& robot = ruler_->robot(0);
  robot.set_state(out.q, out.u);
  out.energy = robot.kinetic_energy() + robot.potential_energy();
}

template <class T>
std::uint64_t BatchEngine<T>::hash(std::uint64_t seed) const {
  // Not of residual and status, which are those of a call: calls differ from engine to engine.
  const std::vector<double> u(u_, u_ + static_cast<size_t>(num_envs_) * nu_);
  return hash_of(u, seed);
}

template <class T>
void BatchEngine<T>::mark() {
  mark_ = {batch_.save_state(), clocks_,
           std::vector<T>(targets_, targets_ + static_cast<size_t>(num_envs_) * joints_), last_};
}

template <class T>
void BatchEngine<T>::rewind() {
  batch_.load_state(mark_.state);
  clocks_ = mark_.clocks;
  last_ = mark_.last;
  set_targets(mark_.targets.data());
}

template class BatchEngine<float>;
template class BatchEngine<double>;

}  // namespace stickslip::benchmarks
