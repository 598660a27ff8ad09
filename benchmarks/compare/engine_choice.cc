#include "benchmarks/compare/engine_choice.h"

#include <algorithm>
#include <sstream>
#include <stdexcept>

#include "benchmarks/compare/cores.h"

namespace stickslip::benchmarks {
namespace {

constexpr double kThreadEfficiency = 0.95;  // two threads: 1.9 times one
constexpr const char* kThreadsSuffix = "_threads";
constexpr const char* kApartSuffix = "_apart";
constexpr double kFloat64Share = 0.5, kAvx2Share = 0.6, kEnergySafeShare = 0.5;

[[noreturn]] void refuse(const std::string& name) {
  throw std::invalid_argument(
      "unknown engine '" + name +
      "'; there are mujoco, semi_implicit, energy_safe and "
      "batch_<float32|float64>[_energy_safe][_avx2|_avx512|_neon][_ungrouped]"
      "[_threads<N>|_apart<N>]");
}

}  // namespace

EngineChoice engine_choice(const std::string& name) {
  EngineChoice e;
  e.name = name;
  if (name == "mujoco") return e;
  e.kind = EngineKind::kWorld;
  if (name == "semi_implicit") return e;
  e.integrator = Integrator::kEnergySafe;
  if (name == "energy_safe") return e;
  e.kind = EngineKind::kBatch;
  e.integrator = Integrator::kSemiImplicit;

  std::string rest = name;
  const auto take = [&](const std::string& part) {
    if (!rest.starts_with(part)) return false;
    const char next = rest.size() > part.size() ? rest[part.size()] : '_';
    if (next != '_') return false;
    rest.erase(0, part.size());
    return true;
  };
  if (take("batch_float32"))
    e.precision = Precision::kFloat32;
  else if (!take("batch_float64"))
    refuse(name);
  if (take("_energy_safe")) e.integrator = Integrator::kEnergySafe;
  for (const char* set : {"avx2", "avx512", "neon"})
    if (e.instruction_set.empty() && take(std::string("_") + set)) e.instruction_set = set;
  e.regroups = !take("_ungrouped");
  for (const std::string suffix : {kThreadsSuffix, kApartSuffix}) {
    if (!rest.starts_with(suffix)) continue;
    const std::string digits = rest.substr(suffix.size());
    if (digits.empty() || digits.size() > 3 ||
        digits.find_first_not_of("0123456789") != std::string::npos)
      refuse(name);
    e.threads = std::stoi(digits);
    e.apart = suffix == kApartSuffix;
    if (e.threads < (e.apart ? 2 : 1)) refuse(name);
    rest.clear();
  }
  if (!rest.empty()) refuse(name);
  return e;
}

std::vector<std::string> default_engines() {
  std::vector<std::string> names{"semi_implicit", "energy_safe", "batch_float32", "batch_float64",
                                 "batch_float32_energy_safe"};
#ifdef __x86_64__
  names.push_back("batch_float32_avx2");
#endif
  if (num_cores() >= 2) {
    names.push_back("batch_float32_threads1");
    names.push_back("batch_float32_threads2");
    names.push_back("batch_float32_apart2");
  }
  names.push_back("mujoco");
  return names;
}

Aim aim_of(const EngineChoice& e, const Scenario& s, const std::string& instruction_set) {
  if (e.kind == EngineKind::kMujoco) return {};
  if (e.kind == EngineKind::kWorld)
    return {"mujoco",
            e.integrator == Integrator::kSemiImplicit ? s.aim_world : s.aim_world_energy_safe};
  if (e.threads > 1)
    return {e.name.substr(0, e.name.rfind('_')) + kThreadsSuffix + "1",
            e.apart ? 0 : kThreadEfficiency * e.threads};
  if (e.threads == 1) return {};
  double aim = s.aim_batch;
  if (instruction_set != "avx512") aim *= kAvx2Share;
  if (e.precision == Precision::kFloat64) aim *= s.aim_batch_variants ? kFloat64Share : 0;
  if (e.integrator == Integrator::kEnergySafe) aim *= s.aim_batch_variants ? kEnergySafeShare : 0;
  return {"mujoco", aim};
}

}  // namespace stickslip::benchmarks
