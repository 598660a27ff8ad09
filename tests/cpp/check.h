// A test harness of one page: TEST(NameIsAClaim) { CHECK(...); }. Each test file is one program; it
// prints every claim.
#pragma once
#include <cmath>
#include <cstdio>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

namespace check {

struct Test {
  const char* name;
  void (*body)();
};
inline std::vector<Test>& tests() {
  static std::vector<Test> all;
  return all;
}
inline int& failures() {
  static int n = 0;
  return n;
}
inline bool add(const char* name, void (*body)()) {
  tests().push_back({name, body});
  return true;
}
inline void fail(const char* file, int line, const std::string& what) {
  ++failures();
  std::printf("  %s:%d: %s\n", file, line, what.c_str());
}
inline std::string show(double a) {
  char text[40];
  std::snprintf(text, sizeof text, "%.17g", a);
  return text;
}

}  // namespace check

#define TEST(name)                                               \
  static void name();                                            \
  static const bool registered_##name = check::add(#name, name); \
  static void name()
#define CHECK(condition) \
  ((condition) ? (void)0 : check::fail(__FILE__, __LINE__, "not true: " #condition))
/// a and b differ by at most tolerance (absolute); NaN fails.
#define CHECK_NEAR(a, b, tolerance)                                                            \
  (std::fabs((a) - (b)) <= (tolerance)                                                         \
       ? (void)0                                                                               \
       : check::fail(__FILE__, __LINE__,                                                       \
                     std::string(#a " = ") + check::show(a) + ", " #b " = " + check::show(b) + \
                         ", apart by " + check::show((a) - (b))))
/// The statement throws `exception`, and its text contains `fragment`.
#define CHECK_THROWS(statement, exception, fragment)                                        \
  do {                                                                                      \
    bool thrown = false;                                                                    \
    try {                                                                                   \
      statement;                                                                            \
    } catch (const exception& e) {                                                          \
      thrown = true;                                                                        \
      if (!std::strstr(e.what(), fragment))                                                 \
        check::fail(__FILE__, __LINE__,                                                     \
                    std::string("the error does not say '") + fragment + "': " + e.what()); \
    }                                                                                       \
    if (!thrown) check::fail(__FILE__, __LINE__, #statement " did not throw " #exception);  \
  } while (0)

int main(int argc, char** argv) {
  for (const check::Test& t : check::tests()) {
    if (argc > 1 && !std::strstr(t.name, argv[1])) continue;
    const int before = check::failures();
    t.body();
    std::printf("%s %s\n", check::failures() == before ? "ok    " : "FAILED", t.name);
  }
  return check::failures() ? 1 : 0;
}
