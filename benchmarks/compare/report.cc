#include "benchmarks/compare/report.h"

#include <mujoco/mujoco.h>

#include <cinttypes>
#include <cmath>
#include <cstdio>

#include "benchmarks/compare/episodes.h"

namespace stickslip::benchmarks {
namespace {

template <class... Values>
std::string format(const char* how, Values... values) {
  char text[256];
  std::snprintf(text, sizeof text, how, values...);
  return text;
}

double target_of(const Scenario& s, const std::string& engine) {
  return engine == "semi_implicit" ? s.target_semi_implicit
         : engine == "energy_safe" ? s.target_energy_safe
                                   : 0;
}

/// An aim needs a ratio: without MuJoCo in the run there is none to miss.
bool misses_aim(const ScenarioResult& r, const Measurement& m) {
  const double ratio = r.ratio(m.engine);
  return ratio > 0 && ratio < target_of(*r.scenario, m.engine);
}

std::string number(double x) { return std::isfinite(x) ? format("%.9g", x) : "null"; }

std::string json_of(const ScenarioResult& r, const Measurement& m) {
  const Findings& f = m.findings;
  std::string out = "    {\"engine\": \"" + m.engine + "\"";
  const auto add = [&](const char* key, const std::string& value) {
    out += std::string(", \"") + key + "\": " + value;
  };
  std::string times, faults;
  for (double t : m.microseconds) times.append(times.empty() ? "" : ", ").append(number(t));
  for (const std::string& t : m.faults)
    faults.append(faults.empty() ? "\"" : ", \"").append(t).append("\"");
  add("us_per_step", number(median(m.microseconds)));
  add("us_per_repetition", "[" + times + "]");
  add("ratio", number(r.ratio(m.engine)));
  add("target_ratio", number(target_of(*r.scenario, m.engine)));
  add("contacts", number(f.contacts));
  add("pushing_contacts", number(f.pushing));
  add("iterations", number(f.iterations));
  add("mean_penetration_m", number(f.mean_penetration));
  add("max_penetration_m", number(f.max_penetration));
  add("energy_settled_J", number(f.energy_settled));
  add("energy_at_end_J", number(f.energy_at_end));
  add("base_height_m", number(f.base_height));
  add("max_velocity", number(f.max_velocity));
  if (m.engine != "mujoco") {
    add("max_residual_m_per_s", number(f.max_residual));
    add("share_above_1e-8", number(f.bad_residual_share));
  }
  add("exploded_steps", std::to_string(f.exploded));
  add("failed_steps", std::to_string(f.failed));
  add("steps", std::to_string(f.steps));
  add("episodes", std::to_string(f.episodes));
  add("hash", format("\"%016" PRIx64 "\"", f.hash));
  add("faults", "[" + faults + "]");
  return out + "}";
}

}  // namespace

void print_header() {
  std::printf("%-13s %-13s %8s %7s %7s %6s %7s %7s %6s %16s %16s %17s\n", "task", "engine",
              "us/step", "min", "ratio", "aim", "contact", "pushing", "iter", "penetration mm",
              "energy J", "residual m/s");
  std::printf("%-13s %-13s %8s %7s %7s %6s %7s %7s %6s %16s %16s %17s\n", "", "", "median", "", "",
              "", "in solve", "", "", "mean / max", "settled -> end", "max (share>1e-8)");
}

void print_result(const ScenarioResult& r) {
  for (const Measurement& m : r.engines) {
    const Findings& f = m.findings;
    double least = 1e300;
    for (double t : m.microseconds) least = std::fmin(least, t);
    const bool ours = m.engine != "mujoco";
    const double ratio = r.ratio(m.engine), target = target_of(*r.scenario, m.engine);
    std::printf(
        "%-13s %-13s %8.2f %7.2f %7s %6s %7.2f %7.2f %6.2f %16s %16s %17s\n",
        r.scenario->name.c_str(), m.engine.c_str(), median(m.microseconds), least,
        ours && ratio > 0 ? format("%.2f", ratio).c_str() : "",
        ours && target > 0 ? format("%.1f%s", target, misses_aim(r, m) ? " !" : "").c_str() : "",
        f.contacts, f.pushing, f.iterations,
        r.scenario->ground
            ? format("%.4f / %.3f", 1e3 * f.mean_penetration, 1e3 * f.max_penetration).c_str()
            : "",
        r.scenario->shows_energy ? format("%.1f -> %.1f", f.energy_settled, f.energy_at_end).c_str()
                                 : "",
        ours ? format("%.1e (%.0e)", f.max_residual, f.bad_residual_share).c_str() : "");
  }
  std::fflush(stdout);
}

bool print_faults(const ScenarioResult& r) {
  bool good = true;
  for (const Measurement& m : r.engines)
    for (const std::string& fault : m.faults) {
      std::printf("FAILED: %s, %s: %s\n", r.scenario->name.c_str(), m.engine.c_str(),
                  fault.c_str());
      good = false;
    }
  return good;
}

bool print_missed_aims(const ScenarioResult& r) {
  bool good = true;
  for (const Measurement& m : r.engines) {
    if (!misses_aim(r, m)) continue;
    std::printf("MISSED: %s, %s: %.2f times MuJoCo's speed, %.1f is aimed at\n",
                r.scenario->name.c_str(), m.engine.c_str(), r.ratio(m.engine),
                target_of(*r.scenario, m.engine));
    good = false;
  }
  return good;
}

std::string to_json(const std::vector<ScenarioResult>& results, const Settings& settings) {
  std::string out =
      "{\n\"mujoco\": \"" + std::string(mj_versionString()) +
      "\", \"compiler\": \"" STICKSLIP_COMPILER "\",\n\"time_step_s\": " + number(kTimeStep) +
      ", \"steps\": " + std::to_string(settings.steps) +
      ", \"repetitions\": " + std::to_string(settings.repetitions) + ",\n\"results\": [";
  for (size_t k = 0; k < results.size(); ++k) {
    const ScenarioResult& r = results[k];
    out += std::string(k ? "," : "") + "\n  {\"task\": \"" + r.scenario->name +
           "\", \"dofs\": " + std::to_string(r.scenario->model->nu()) +
           ", \"model_disagreement\": " + number(r.disagreement) +
           ", \"core_share\": " + number(r.core_share) + ", \"engines\": [\n";
    for (size_t i = 0; i < r.engines.size(); ++i)
      out += (i ? ",\n" : "") + json_of(r, r.engines[i]);
    out += "]}";
  }
  return out + "\n]}\n";
}

}  // namespace stickslip::benchmarks
