// The words that Python uses for enumerations.
#pragma once
#include <stickslip/contact.h>
#include <stickslip/errors.h>
#include <stickslip/world.h>

#include <cstddef>
#include <string>

namespace stickslip::python {

template <class E>
struct Word {
  const char* text;
  E value;
};

inline constexpr Word<FrictionLaw> kFrictionLaws[] = {
    {"coulomb", FrictionLaw::kCoulomb},
    {"max_dissipation", FrictionLaw::kMaxDissipation},
};
inline constexpr Word<SingleContactMethod> kSingleContactMethods[] = {
    {"halley", SingleContactMethod::kHalley},
    {"bisection", SingleContactMethod::kBisection},
    {"golden_section", SingleContactMethod::kGoldenSection},
    {"quartic", SingleContactMethod::kQuartic},
};
inline constexpr Word<SolveMethod> kSolveMethods[] = {
    {"auto", SolveMethod::kAuto},
    {"per_contact", SolveMethod::kPerContact},
    {"pgs", SolveMethod::kPgs},
    {"prox_newton", SolveMethod::kProxNewton},
    {"interior_point", SolveMethod::kInteriorPoint},
    {"admm", SolveMethod::kAdmm},
};
/// Those that a world may use in its steps.
inline constexpr Word<SolveMethod> kStepMethods[] = {
    {"auto", SolveMethod::kAuto},
    {"per_contact", SolveMethod::kPerContact},
    {"pgs", SolveMethod::kPgs},
};
inline constexpr Word<Integrator> kIntegrators[] = {
    {"energy_safe", Integrator::kEnergySafe},
    {"semi_implicit", Integrator::kSemiImplicit},
};

/// What a word of an argument stands for. Throws ModelError that lists the choices.
template <class E, std::size_t N>
E choice(const char* argument, const std::string& text, const Word<E> (&words)[N]) {
  std::string choices;
  for (const Word<E>& word : words) {
    if (text == word.text) return word.value;
    choices += std::string(choices.empty() ? "'" : ", '") + word.text + "'";
  }
  throw ModelError(std::string(argument) + " is '" + text + "'; choose one of " + choices);
}

/// The word for a value.
template <class E, std::size_t N>
const char* word_for(E value, const Word<E> (&words)[N]) {
  for (const Word<E>& word : words)
    if (word.value == value) return word.text;
  return "";
}

}  // namespace stickslip::python
