#include "benchmarks/compare/report.h"

#include <mujoco/mujoco.h>

#include <algorithm>
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

std::string number(double x) { return std::isfinite(x) ? format("%.9g", x) : "null"; }

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + "\"";
}

template <class Range, class Function>
std::string list(const Range& range, Function&& text_of) {
  std::string out;
  for (const auto& item : range) out.append(out.empty() ? "" : ", ").append(text_of(item));
  return "[" + out + "]";
}

std::string json_of(const ScenarioResult& r, const Measurement& m) {
  const Findings& f = m.findings;
  std::string out = "    {\"engine\": " + quoted(m.engine.name);
  const auto add = [&](const char* key, const std::string& value) {
    out += std::string(", \"") + key + "\": " + value;
  };
  const double us = m.microseconds_per_step();
  add("us_per_step", number(us));
  add("us_per_repetition", list(m.microseconds, number));
  add("robot_steps_per_s", number(us > 0 ? 1e6 / us : 0));
  add("clock", m.engine.wall_clock() ? "\"wall\"" : "\"cpu\"");
  add("ratio", number(r.ratio(m)));
  add("ratio_to", quoted(r.aim(m).against));
  add("target_ratio", number(r.aim(m).ratio));
  add("robots", std::to_string(m.robots));
  add("robot_steps", std::to_string(m.robot_steps));
  if (m.engine.kind == EngineKind::kBatch) {
    add("threads", std::to_string(std::max(1, m.engine.threads)));
    add("batches", std::to_string(m.engine.apart ? m.engine.threads : 1));
    add("instruction_set", quoted(m.instruction_set));
  }
  add("contacts", number(f.contacts));
  add("pushing_contacts", number(f.pushing));
  add("iterations", number(f.iterations));
  add("mean_penetration_m", number(f.mean_penetration));
  add("max_penetration_m", number(f.max_penetration));
  add("energy_settled_J", number(f.energy_settled));
  add("energy_at_end_J", number(f.energy_at_end));
  add("base_height_m", number(f.base_height));
  add("max_velocity", number(f.max_velocity));
  if (m.engine.kind != EngineKind::kMujoco) {
    const Residuals& s = f.residuals;
    add("residual_tolerance_m_per_s", number(s.tolerance()));
    add("median_residual_m_per_s", number(s.quantile(0.5)));
    add("residual_99_m_per_s", number(s.quantile(0.99)));
    add("residual_99_99_m_per_s", number(s.quantile(0.9999)));
    add("max_residual_m_per_s", number(s.largest()));
    add("share_above_tolerance", number(s.share_above()));
    add("flagged_steps", std::to_string(s.flagged()));
    add("unflagged_steps", std::to_string(s.unflagged()));
    add("watched_steps", std::to_string(s.count()));
    if (const Residuals& o = f.second_opinion; o.count() > 0) {
      add("second_opinion_99_99_m_per_s", number(o.quantile(0.9999)));
      add("second_opinion_max_m_per_s", number(o.largest()));
      add("second_opinion_share_above", number(o.share_above()));
      add("second_opinion_steps", std::to_string(o.count()));
      add("other_contacts_steps", std::to_string(f.other_contacts));
    }
  }
  add("exploded_steps", std::to_string(f.exploded));
  add("failed_steps", std::to_string(f.failed));
  add("steps", std::to_string(f.steps));
  add("episodes", std::to_string(f.episodes));
  add("hash", format("\"%016" PRIx64 "\"", m.hash));
  add("faults", list(m.faults, quoted));
  return out + "}";
}

constexpr const char* kLine = "%-13s %-26s %8s %8s %8s %7s %6s %7s %7s %6s %16s %16s %25s\n";

std::string ratio_text(const ScenarioResult& r, const Measurement& m) {
  return r.ratio(m) > 0 ? format("%.2f", r.ratio(m)) : "";
}

std::string aim_text(const ScenarioResult& r, const Measurement& m) {
  const double aim = r.aim(m).ratio;
  return aim > 0 ? format("%.3g%s", aim, r.misses_aim(m) ? " !" : "") : "";
}

std::string residual_text(const Measurement& m) {
  const Residuals& s = m.findings.residuals;
  if (m.engine.kind == EngineKind::kMujoco || s.count() == 0) return "";
  return format("%.0e / %.0e (%.0e)", s.quantile(0.9999), s.largest(), s.share_above());
}

}  // namespace

void print_header() {
  std::printf(kLine, "task", "engine", "us/step", "min", "million", "ratio", "aim", "contact",
              "pushing", "iter", "penetration mm", "energy J", "residual m/s");
  std::printf(kLine, "", "", "mean", "", "steps/s", "", "", "in solve", "", "", "mean / max",
              "settled -> end", "99.99 % / max (share>tol)");
}

void print_result(const ScenarioResult& r) {
  for (const Measurement& m : r.engines) {
    if (m.microseconds.empty()) continue;  // print_faults says why
    const Findings& f = m.findings;
    const double us = m.microseconds_per_step();
    const double least = *std::min_element(m.microseconds.begin(), m.microseconds.end());
    std::printf(
        kLine, r.scenario->name.c_str(), m.engine.name.c_str(), format("%.3f", us).c_str(),
        format("%.3f", least).c_str(), format("%.3f", 1 / us).c_str(), ratio_text(r, m).c_str(),
        aim_text(r, m).c_str(), format("%.2f", f.contacts).c_str(),
        format("%.2f", f.pushing).c_str(), m.robots > 1 ? "" : format("%.2f", f.iterations).c_str(),
        r.scenario->ground
            ? format("%.4f / %.3f", 1e3 * f.mean_penetration, 1e3 * f.max_penetration).c_str()
            : "",
        r.scenario->shows_energy ? format("%.1f -> %.1f", f.energy_settled, f.energy_at_end).c_str()
                                 : "",
        residual_text(m).c_str());
  }
  std::fflush(stdout);
}

void print_second_opinions(const std::vector<ScenarioResult>& results) {
  bool first = true;
  for (const ScenarioResult& r : results)
    for (const Measurement& m : r.engines) {
      const Residuals& own = m.findings.residuals;
      const Residuals& o = m.findings.second_opinion;
      if (o.count() == 0) continue;
      if (first) std::printf("\nresiduals of sampled steps by the problem of a World in double:\n");
      first = false;
      std::printf(
          "%-13s %-26s 99.99 %%: %.0e (own: %.0e), max: %.0e (own: %.0e), above %.0e: %.0e\n",
          r.scenario->name.c_str(), m.engine.name.c_str(), o.quantile(0.9999), own.quantile(0.9999),
          o.largest(), own.largest(), o.tolerance(), o.share_above());
    }
}

bool print_faults(const ScenarioResult& r) {
  bool good = true;
  for (const Measurement& m : r.engines)
    for (const std::string& fault : m.faults) {
      std::printf("FAILED: %s, %s: %s\n", r.scenario->name.c_str(), m.engine.name.c_str(),
                  fault.c_str());
      good = false;
    }
  return good;
}

bool print_missed_aims(const std::vector<ScenarioResult>& results) {
  bool good = true;
  const auto reached_in_group = [&](const ScenarioResult& r, const Measurement& m) {
    return std::any_of(results.begin(), results.end(), [&](const ScenarioResult& other) {
      const Measurement* same = other.find(m.engine.name);
      return other.scenario->aim_group == r.scenario->aim_group && same &&
             other.ratio(*same) >= other.aim(*same).ratio;
    });
  };
  for (const ScenarioResult& r : results)
    for (const Measurement& m : r.engines) {
      if (!r.misses_aim(m)) continue;
      if (!r.scenario->aim_group.empty() && reached_in_group(r, m)) continue;
      std::printf("MISSED: %s, %s: %.2f times the speed of %s, %.3g is aimed at\n",
                  r.scenario->name.c_str(), m.engine.name.c_str(), r.ratio(m),
                  r.aim(m).against.c_str(), r.aim(m).ratio);
      good = false;
    }
  return good;
}

std::string to_json(const std::vector<ScenarioResult>& results, const Settings& settings) {
  std::string out =
      "{\n\"mujoco\": \"" + std::string(mj_versionString()) +
      "\", \"compiler\": \"" STICKSLIP_COMPILER "\",\n\"time_step_s\": " + number(kTimeStep) +
      ", \"steps\": " + std::to_string(settings.steps) +
      ", \"repetitions\": " + std::to_string(settings.repetitions) +
      ", \"robots\": " + std::to_string(settings.robots) + ",\n\"results\": [";
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
