// Results for people (a table) and for programs (JSON).
#pragma once
#include <string>

#include "benchmarks/compare/measure.h"

namespace stickslip::benchmarks {

void print_header();
/// One line per engine.
void print_result(const ScenarioResult& result);
/// True when every engine's result counts; prints why not.
bool print_faults(const ScenarioResult& result);
/// True when no engine misses its aim; prints which does.
bool print_missed_aims(const ScenarioResult& result);

std::string to_json(const std::vector<ScenarioResult>& results, const Settings& settings);

}  // namespace stickslip::benchmarks
