// Results for people (a table) and for programs (JSON).
#pragma once
#include <string>

#include "benchmarks/compare/measure.h"

namespace stickslip::benchmarks {

void print_header();
/// One line per engine.
void print_result(const ScenarioResult& result);
/// Residuals of batches, judged from outside.
void print_second_opinions(const std::vector<ScenarioResult>& results);
/// True when every engine's result counts; prints why not.
bool print_faults(const ScenarioResult& result);
/// True when no engine misses its aim (of a group of tasks: on all of them); prints which does.
bool print_missed_aims(const std::vector<ScenarioResult>& results);

std::string to_json(const std::vector<ScenarioResult>& results, const Settings& settings);

}  // namespace stickslip::benchmarks
