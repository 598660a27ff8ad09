// The tasks of scenes/, run in C++ loops. The documented front is python/stickslip/scenes.py.
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>
#include <stickslip/errors.h>
#include <stickslip/world.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "bindings.h"
#include "scenes/experiments.h"
#include "scenes/statistics.h"
#include "scenes/tasks.h"

namespace nb = nanobind;
using namespace nb::literals;

namespace stickslip::python {
namespace {

using scenes::Statistics;
using scenes::Task;

std::vector<std::string> task_names() {
  std::vector<std::string> names;
  for (const scenes::TaskSpec& spec : scenes::task_specs()) names.push_back(spec.name);
  return names;
}

nb::tuple initial_state(const std::string& task, int episode) {
  ArrayOut q = make_array({7 + scenes::kNumJoints}, [](std::span<double>) {});
  ArrayOut u = make_array({6 + scenes::kNumJoints}, [](std::span<double>) {});
  scenes::initial_state(scenes::task_spec(task).kind, episode, {q.data(), q.size()},
                        {u.data(), u.size()});
  return nb::make_tuple(q, u);
}

/// Integers that come in: episodes, numbers of targets.
using IndicesIn = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

/// q (n, 19), u (n, 18) at the start of episodes.
nb::tuple initial_states(const std::string& task, const IndicesIn& episodes) {
  constexpr std::size_t nq = 7 + scenes::kNumJoints, nu = 6 + scenes::kNumJoints;
  const scenes::TaskKind kind = scenes::task_spec(task).kind;
  const std::size_t n = episodes.size();
  ArrayOut q = make_array({n, nq}, [](std::span<double>) {});
  ArrayOut u = make_array({n, nu}, [](std::span<double>) {});
  for (std::size_t k = 0; k < n; ++k)
    scenes::initial_state(kind, static_cast<int>(episodes.data()[k]), {q.data() + k * nq, nq},
                          {u.data() + k * nu, nu});
  return nb::make_tuple(q, u);
}

/// (n, 12) PD targets [rad]: of each of the episodes the one with this number.
ArrayOut pd_targets(const std::string& task, const IndicesIn& episodes, const IndicesIn& numbers) {
  if (episodes.size() != numbers.size())
    throw ModelError("numbers has " + std::to_string(numbers.size()) + " entries; there are " +
                     std::to_string(episodes.size()) + " episodes");
  const scenes::TaskKind kind = scenes::task_spec(task).kind;
  return make_array({episodes.size(), scenes::kNumJoints}, [&](std::span<double> to) {
    for (std::size_t k = 0; k < episodes.size(); ++k)
      scenes::pd_target(kind, static_cast<int>(episodes.data()[k]),
                        static_cast<int>(numbers.data()[k]),
                        to.subspan(k * scenes::kNumJoints, scenes::kNumJoints));
  });
}

/// Runs `steps` steps, the next episode where one is over, and lets Ctrl-C through. Returns how
/// many episodes ended.
int run(Task& task, World& world, Robot& robot, long steps, Statistics* statistics) {
  constexpr long kStepsBetweenSignals = 2048;
  int ended = 0;
  for (long done = 0; done < steps;) {
    const long end = std::min(steps, done + kStepsBetweenSignals);
    {
      nb::gil_scoped_release free_interpreter;
      for (; done < end; ++done) {
        task.before_step(robot);
        world.step();
        if (statistics) statistics->observe(robot);
        if (!task.after_step(robot)) continue;
        ++ended;
        task.reset(robot, task.episode() + 1);
        if (statistics) statistics->begin(robot);
      }
    }
    if (PyErr_CheckSignals() != 0) throw nb::python_error();
  }
  return ended;
}

/// Runs `step` that often in C++, and lets Ctrl-C through.
template <class Step>
void repeat(long times, Step&& step) {
  constexpr long kBetweenSignals = 2048;
  for (long done = 0; done < times;) {
    const long end = std::min(times, done + kBetweenSignals);
    {
      nb::gil_scoped_release free_interpreter;
      for (; done < end; ++done) step();
    }
    if (PyErr_CheckSignals() != 0) throw nb::python_error();
  }
}

/// (steps, 8): contacts, sweeps, Newton steps, residual, penetration, impact, converged, episode
/// over; see StepRecord.
ArrayOut record(Task& task, World& world, Robot& robot, long steps) {
  scenes::Recorder recorder;
  std::vector<double> rows;
  rows.reserve(8 * steps);
  repeat(steps, [&] {
    const scenes::StepRecord r = recorder.step(task, world, robot);
    rows.insert(rows.end(),
                {double(r.contacts), double(r.sweeps), double(r.newton_steps), r.residual,
                 r.penetration, double(r.impact), double(r.converged), double(r.episode_over)});
  });
  return make_array({static_cast<std::size_t>(steps), 8},
                    [&](std::span<double> to) { std::copy(rows.begin(), rows.end(), to.begin()); });
}

/// (delassus (k, 3, 3), free velocity (k, 3), friction (k,), steps, contacts looked at).
nb::tuple sample_slipping(Task& task, World& world, Robot& robot, long wanted, long max_steps) {
  scenes::SlipSamples s;
  constexpr long kStepsAtOnce = 512;
  repeat((max_steps + kStepsAtOnce - 1) / kStepsAtOnce,
         [&] { scenes::sample_slipping(task, world, robot, wanted, kStepsAtOnce, s); });
  const std::size_t n = s.friction.size();
  const auto copy = [](const std::vector<double>& from) {
    return [&from](std::span<double> to) { std::copy(from.begin(), from.end(), to.begin()); };
  };
  return nb::make_tuple(make_array({n, 3, 3}, copy(s.delassus)),
                        make_array({n, 3}, copy(s.free_velocity)), copy_array(s.friction), s.steps,
                        s.contacts);
}

/// A list of (delassus (3n, 3n), free velocity (3n,), friction (n,), impulse (3n,)).
nb::list sample_problems(Task& task, World& world, Robot& robot, long steps, int stride) {
  if (stride < 1) throw ModelError("sample_problems: stride must be at least 1");
  std::vector<scenes::ProblemSample> samples;
  {
    nb::gil_scoped_release free_interpreter;
    scenes::sample_problems(task, world, robot, steps, stride, samples);
  }
  nb::list out;
  for (const auto& s : samples) {
    const std::size_t rows = s.problem.free_velocity.size();
    const auto copy = [&](std::span<double> to) {
      std::copy(s.problem.delassus.begin(), s.problem.delassus.end(), to.begin());
    };
    out.append(nb::make_tuple(make_array({rows, rows}, copy), copy_array(s.problem.free_velocity),
                              copy_array(s.problem.friction), copy_array(s.impulse)));
  }
  return out;
}

void bind_statistics(nb::module_& m) {
  nb::class_<Statistics>(m, "Statistics")
      .def(
          "__init__",
          [](Statistics* self, const World& world, double settle, bool track_energy) {
            new (self) Statistics(world.options(), settle, track_energy);
          },
          "world"_a, "settle"_a, "track_energy"_a)
      .def("begin", &Statistics::begin, "robot"_a)
      .def("observe", &Statistics::observe, "robot"_a)
      .def_ro("steps", &Statistics::steps)
      .def_ro("episodes", &Statistics::episodes)
      .def_prop_ro("mean_penetration", &Statistics::mean_penetration)
      .def_ro("max_penetration", &Statistics::max_penetration)
      .def_ro("max_landing_penetration", &Statistics::max_landing_penetration)
      .def_ro("max_velocity", &Statistics::max_velocity)
      .def_ro("exploded", &Statistics::exploded)
      .def_ro("max_energy_growth", &Statistics::max_energy_growth)
      .def_ro("distance", &Statistics::distance)
      .def_ro("slip", &Statistics::slip)
      .def_ro("contacts", &Statistics::contacts)
      .def_ro("sweeps", &Statistics::sweeps)
      .def_ro("newton_steps", &Statistics::newton_steps)
      .def_ro("substeps", &Statistics::substeps)
      .def_ro("max_residual", &Statistics::max_residual)
      .def_ro("not_converged", &Statistics::not_converged);
}

}  // namespace

void bind_scenes(nb::module_& parent) {
  nb::module_ m = parent.def_submodule("scenes");
  m.def("task_names", &task_names);
  m.def(
      "task_model",
      [](const std::string& task, ModelPtr anymal) {
        return scenes::task_model(scenes::task_spec(task).kind, anymal);
      },
      "task"_a, "anymal"_a);
  m.def("initial_state", &initial_state, "task"_a, "episode"_a);
  m.def("initial_states", &initial_states, "task"_a, "episodes"_a);
  m.def("pd_targets", &pd_targets, "task"_a, "episodes"_a, "numbers"_a);
  nb::class_<scenes::TaskSpec>(m, "TaskSpec")
      .def_ro("kp", &scenes::TaskSpec::kp)
      .def_ro("kd", &scenes::TaskSpec::kd)
      .def_ro("episode", &scenes::TaskSpec::episode)
      .def_ro("moving_targets", &scenes::TaskSpec::moving_targets)
      .def_ro("ends_when_still", &scenes::TaskSpec::ends_when_still);
  m.def("task_spec", [](const std::string& task) { return scenes::task_spec(task); }, "task"_a);
  nb::class_<Task>(m, "Task")
      .def(
          "__init__",
          [](Task* self, const std::string& task, double time_step) {
            new (self) Task(scenes::task_spec(task).kind, time_step);
          },
          "task"_a, "time_step"_a)
      .def_prop_ro("episode", &Task::episode)
      .def_prop_ro("time", &Task::time)
      .def_prop_ro("episode_length", [](const Task& t) { return t.spec().episode; })
      .def("reset", &Task::reset, "robot"_a, "episode"_a)
      .def("run", &run, "world"_a, "robot"_a, "steps"_a, "statistics"_a.none() = nb::none())
      .def("record", &record, "world"_a, "robot"_a, "steps"_a)
      .def("sample_slipping", &sample_slipping, "world"_a, "robot"_a, "wanted"_a, "max_steps"_a)
      .def("sample_problems", &sample_problems, "world"_a, "robot"_a, "steps"_a, "stride"_a);
  bind_statistics(m);
}

}  // namespace stickslip::python
