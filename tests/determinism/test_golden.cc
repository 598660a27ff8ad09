// The bits of known scenes are those of golden.txt, whatever the compiler's optimization: this
// program is built twice, the second time with all of the step compiled at -O1.
//
// A change that means to change bits renews the file (golden.txt says how) and says so in its
// commit.
#include <cinttypes>
#include <fstream>
#include <map>
#include <sstream>

#include "tests/determinism/batch_hash.h"

namespace {

std::map<std::string, std::uint64_t> read_golden() {
  std::map<std::string, std::uint64_t> out;
  std::ifstream file(STICKSLIP_GOLDEN);
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    const size_t space = line.find(' ');
    out[line.substr(space + 1)] = std::stoull(line.substr(0, space), nullptr, 16);
  }
  return out;
}

/// STICKSLIP_WRITE_GOLDEN=1 in the environment writes instead of comparing.
bool writes_golden() {
  const char* wanted = std::getenv("STICKSLIP_WRITE_GOLDEN");
  return wanted && std::string(wanted) == "1";
}

bool write_golden(const std::vector<state_hash::Entry>& entries) {
  if (!writes_golden()) return false;
  std::FILE* file = std::fopen(STICKSLIP_GOLDEN, "w");
  if (!file) return false;
  std::fprintf(
      file,
      "# hash of q, u and impulses at the end | scene, integrator, time step, steps "
      "(tests/determinism)\n"
      "# hash of q, u and impulses on the way | batch, scene, integrator, time step, steps\n"
      "# hash of the first twenty problems | problems, family\n"
      "# renewed with: STICKSLIP_WRITE_GOLDEN=1 <build>/tests/determinism/determinism_golden\n");
  for (const state_hash::Entry& e : entries)
    std::fprintf(file, "%016" PRIx64 " %s\n", e.hash, e.name.c_str());
  std::fclose(file);
  return true;
}

const stickslip::ModelPtr& anymal() {
  static const stickslip::ModelPtr model = stickslip::load_urdf(STICKSLIP_ANYMAL);
  return model;
}

}  // namespace

TEST(BitsOfKnownScenesAreThoseOnFile) {
  std::vector<state_hash::Entry> now = state_hash::all(anymal());
  for (const state_hash::Entry& e : batch_hash::all(anymal())) now.push_back(e);
  if (write_golden(now)) return;
  const std::map<std::string, std::uint64_t> golden = read_golden();
  CHECK(golden.size() == now.size());
  for (const state_hash::Entry& e : now) {
    const auto found = golden.find(e.name);
    if (found == golden.end() || found->second != e.hash)
      std::printf("  %s: %016" PRIx64 ", on file %016" PRIx64 "\n", e.name.c_str(), e.hash,
                  found == golden.end() ? 0 : found->second);
    CHECK(found != golden.end() && found->second == e.hash);
  }
}

namespace {

using batch_hash::TaskKind;
using stickslip::Integrator, stickslip::Precision;

void check_ways(TaskKind kind, Integrator integrator, Precision precision, std::uint64_t expected) {
  const bool threads = kind == TaskKind::kDrop || kind == TaskKind::kRandom;
  for (const batch_hash::How& how : batch_hash::ways(precision, threads)) {
    const std::uint64_t hash = batch_hash::of_batch(kind, anymal(), integrator, precision, how);
    if (hash != expected)
      std::printf("  %s, %s: %016" PRIx64 " instead of %016" PRIx64 "\n",
                  batch_hash::name(kind, integrator, precision).c_str(), how.text().c_str(), hash,
                  expected);
    CHECK(hash == expected);
  }
}

}  // namespace

TEST(PacksThreadsPlacesAndSnapshotsOfABatchDoNotShowInItsBits) {
  if (writes_golden()) return;
  const std::map<std::string, std::uint64_t> golden = read_golden();
  for (const Integrator integrator : bodies::kBoth)
    for (const TaskKind kind : batch_hash::kTasks) {
      const auto found = golden.find(batch_hash::name(kind, integrator, Precision::kFloat32));
      CHECK(found != golden.end());
      if (found != golden.end()) check_ways(kind, integrator, Precision::kFloat32, found->second);
    }
}

TEST(BatchesInDoublePrecisionHaveTheBitsOfWorlds) {
  for (const Integrator integrator : bodies::kBoth)
    for (const TaskKind kind : batch_hash::kTasks)
      check_ways(kind, integrator, Precision::kFloat64,
                 batch_hash::of_worlds(kind, anymal(), integrator));
}
