// The bits of known scenes are those of golden.txt, whatever the compiler's optimization: this
// program is built twice, the second time with all of the step compiled at -O1.
//
// A change that means to change bits renews the file (golden.txt says how) and says so in its
// commit.
#include <cinttypes>
#include <fstream>
#include <map>
#include <sstream>

#include "tests/determinism/state_hash.h"

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
bool write_golden(const std::vector<state_hash::Entry>& entries) {
  const char* wanted = std::getenv("STICKSLIP_WRITE_GOLDEN");
  if (!wanted || std::string(wanted) != "1") return false;
  std::FILE* file = std::fopen(STICKSLIP_GOLDEN, "w");
  if (!file) return false;
  std::fprintf(
      file,
      "# hash of q, u and impulses at the end | scene, integrator, time step, steps "
      "(tests/determinism)\n"
      "# hash of the first twenty problems | problems, family\n"
      "# renewed with: STICKSLIP_WRITE_GOLDEN=1 <build>/tests/determinism/determinism_golden\n");
  for (const state_hash::Entry& e : entries)
    std::fprintf(file, "%016" PRIx64 " %s\n", e.hash, e.name.c_str());
  std::fclose(file);
  return true;
}

}  // namespace

TEST(BitsOfKnownScenesAreThoseOnFile) {
  const std::vector<state_hash::Entry> now =
      state_hash::all(stickslip::load_urdf(STICKSLIP_ANYMAL));
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
