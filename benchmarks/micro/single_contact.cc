// ns per solve, evaluations and failures of every single-contact method on the four random families
// (slips only).
#include <cstdio>

#include "scenes/contact_families.h"
#include "scenes/time_methods.h"

using namespace stickslip;
using contact::Method;

int main() {
  constexpr const char* kNames[] = {"halley", "bisection", "golden_section", "quartic"};
  std::printf("%-16s %-16s %-8s %-15s %9s %8s %9s\n", "family", "law", "tol N s", "method",
              "ns/solve", "evals", "failures");
  for (const auto family :
       {scenes::ContactFamily::kNearDiagonal, scenes::ContactFamily::kWishart,
        scenes::ContactFamily::kRobotFoot, scenes::ContactFamily::kIllConditioned}) {
    const auto problems = scenes::random_contacts(family, 20000, 3, scenes::ContactMix::kSlipOnly);
    std::vector<double> G, c, mu;
    for (const auto& p : problems) {
      G.insert(G.end(), p.G.begin(), p.G.end()), c.insert(c.end(), p.c.begin(), p.c.end());
      mu.push_back(p.mu);
    }
    auto contacts = scenes::prepare_contacts(G.data(), c.data(), mu.data(), mu.size());
    for (const bool max_dissipation : {true, false})
      for (const double tolerance : {1e-6, 1e-10}) {
        std::vector<Method> methods{Method::kHalley, Method::kBisection, Method::kQuartic};
        if (max_dissipation) methods.push_back(Method::kGoldenSection);
        const auto times = scenes::time_methods(contacts, methods, max_dissipation, tolerance);
        for (std::size_t m = 0; m < methods.size(); ++m)
          std::printf("%-16s %-16s %-8.0e %-15s %9.1f %8.2f %8.3f%%\n", scenes::family_name(family),
                      max_dissipation ? "max_dissipation" : "coulomb", tolerance,
                      kNames[int(methods[m])], times[m].ns_per_solve, times[m].evaluations,
                      100 * times[m].failures);
      }
  }
}
