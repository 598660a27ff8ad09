#include "benchmarks/contact/report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numeric>
#include <stdexcept>

namespace stickslip::benchmarks {
namespace {

double quantile(std::vector<double> x, double q) {
  std::sort(x.begin(), x.end());
  return x[static_cast<std::size_t>(q * static_cast<double>(x.size() - 1))];
}

double share_within(const std::vector<double>& residual, double level) {
  const auto solved =
      std::count_if(residual.begin(), residual.end(), [level](double e) { return e <= level; });
  return static_cast<double>(solved) / static_cast<double>(residual.size());
}

void write_array(std::ofstream& out, const char* name, const std::vector<double>& values) {
  char text[32];
  out << "\"" << name << "\": [";
  for (std::size_t k = 0; k < values.size(); ++k) {
    // JSON has no infinity; 1e300 is not solved either.
    std::snprintf(text, sizeof text, "%s%.4g", k ? ", " : "", std::min(values[k], 1e300));
    out << text;
  }
  out << "]";
}

}  // namespace

void print_table(const SetResult& result, const Methods& methods) {
  std::printf("\n%s: %d problems, %.1f contacts\n", result.name.c_str(), result.problems,
              result.mean_contacts);
  std::printf("%-24s %-26s %9s %9s %10s %10s %10s %10s\n", "solver", "setting", "<= 1e-6",
              "<= 1e-8", "mean us", "p50 us", "p99 us", "residual");
  for (std::size_t m = 0; m < methods.size(); ++m) {
    const Measurement& x = result.measurements[m];
    const double mean = std::accumulate(x.microseconds.begin(), x.microseconds.end(), 0.0) /
                        static_cast<double>(x.microseconds.size());
    std::printf("%-24s %-26s %8.2f%% %8.2f%% %10.2f %10.2f %10.2f %10.1e\n",
                methods[m]->solver().c_str(), methods[m]->setting().c_str(),
                100 * share_within(x.residual, 1e-6), 100 * share_within(x.residual, 1e-8), mean,
                quantile(x.microseconds, 0.5), quantile(x.microseconds, 0.99),
                quantile(x.residual, 0.5));
  }
  std::fflush(stdout);
}

void write_json(const std::string& path, const std::vector<SetResult>& results,
                const Methods& methods) {
  std::ofstream out(path);
  out << "{\"compiler\": \"" << STICKSLIP_COMPILER << "\",\n \"sets\": [";
  for (std::size_t s = 0; s < results.size(); ++s) {
    const SetResult& r = results[s];
    out << (s ? ",\n" : "\n") << "  {\"name\": \"" << r.name << "\", \"group\": \"" << r.group
        << "\", \"contacts\": " << r.mean_contacts << ", \"methods\": [";
    for (std::size_t m = 0; m < methods.size(); ++m) {
      out << (m ? ",\n" : "\n") << "   {\"solver\": \"" << methods[m]->solver()
          << "\", \"setting\": \"" << methods[m]->setting()
          << "\", \"rounds\": " << r.measurements[m].rounds << ",\n    ";
      write_array(out, "microseconds", r.measurements[m].microseconds);
      out << ",\n    ";
      write_array(out, "residual", r.measurements[m].residual);
      out << "}";
    }
    out << "]}";
  }
  out << "]}\n";
  if (!out) throw std::runtime_error("cannot write " + path);
}

}  // namespace stickslip::benchmarks
