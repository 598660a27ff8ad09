// Time and residual of every method on every problem of a set, in turns.
#pragma once
#include "benchmarks/contact/method.h"
#include "benchmarks/contact/problem_sets.h"

namespace stickslip::benchmarks {

struct MeasureSettings {
  int rounds = 5;         ///< counted ones, after one that finds the residuals
  int turn = 200;         ///< problems that a method solves before the next method's turn
  double patience = 0.5;  ///< [s] a method that has taken longer for the set is not timed again
};

/// What one method did on one set.
struct Measurement {
  std::vector<double> microseconds;  ///< per problem, median over the rounds [us]
  std::vector<double> residual;      ///< per problem, largest contact residual over max|c| [1]
  int rounds = 0;                    ///< behind each median
};

/// Largest |free velocity| [m/s].
double velocity_scale(const ContactProblem& problem);

/// Largest contact residual [m/s] of the impulses, by the library's pure function; infinite where
/// they are not finite.
double worst_residual(const ContactProblem& problem, const std::vector<double>& impulse);

/// One measurement per method.
std::vector<Measurement> measure(const ProblemSet& set, const Methods& methods,
                                 const MeasureSettings& settings);

}  // namespace stickslip::benchmarks
