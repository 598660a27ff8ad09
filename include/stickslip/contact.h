// Frictional contact problems and their solvers, without robots.
//
// For n contacts, find impulses lambda [N s] so that v = G lambda + c [m/s] obeys Signorini's
// condition and Coulomb's law at each contact (docs/theory/contact.md). Per contact the order is x,
// y (tangential), z (normal).
#pragma once
#include <string>
#include <vector>

namespace stickslip {

/// Law for sliding contacts.
enum class FrictionLaw {
  kCoulomb,         ///< friction exactly opposite to the sliding velocity, [Hwangbo 2018] eq. 6
  kMaxDissipation,  ///< least kinetic energy of the contact point, [Hwangbo 2018] eq. 8
};

/// Method for one contact (docs/theory/contact.md, section 3).
enum class SingleContactMethod {
  kHalley,         ///< safeguarded Halley steps on one quartic, no trigonometry; the default
  kBisection,      ///< [Hwangbo 2018] Algorithm 1, corrected
  kGoldenSection,  ///< [Preclik 2014]; kMaxDissipation only
  kQuartic,        ///< closed form of the quartic; fails now and then, and says so
};

/// Method for several contacts.
enum class SolveMethod {
  kAuto,        ///< warm-started sweeps, one Halley step per visit, Newton finish; the default
  kPerContact,  ///< [Hwangbo 2018] Algorithm 2
  kPgs,         ///< projected Gauss-Seidel, [Hwangbo 2018] eq. 17, 18
};

/// How a solve ended. Anything but kConverged returns the best impulse found, with its residual.
enum class SolveStatus {
  kConverged,     ///< the largest contact residual is at most the tolerance
  kNotConverged,  ///< cause: sweeps or steps used up; the residual says how far; raise max_sweeps
                  ///< or use kAuto
  kInfeasible,    ///< a contact cannot push (G_zz near 0) and its normal velocity stays negative
};

/// What ends the sweeps of kPerContact and kPgs, once it is at most the tolerance.
enum class StopTest {
  kResidual,      ///< the largest contact residual [m/s]
  kViolationSum,  ///< what each contact violates of its law, added [m/s]: the paper's for
                  ///< kPerContact
  kUpdateSum,  ///< impulse updates [N s] and penetration velocities [m/s], added: the paper's for
               ///< kPgs
};

/// A dense contact problem. `delassus` is row-major (3n, 3n) [1/kg], symmetric positive
/// semidefinite; `free_velocity` (3n) [m/s]; `friction` (n) [1], zero or positive; infinite and
/// huge values count as 1e4.
struct ContactProblem {
  std::vector<double> delassus;       ///< (3n, 3n) row-major [1/kg]
  std::vector<double> free_velocity;  ///< (3n) [m/s]
  std::vector<double> friction;       ///< (n) [1]
  /// n, as many as `friction` has.
  int num_contacts() const { return static_cast<int>(friction.size()); }
  /// Throws ModelError that names the argument and its first offending index (lengths, NaN,
  /// asymmetry, negative diagonal, indefinite matrix, negative friction).
  void validate() const;
};

/// How to solve a problem, and how far.
struct SolveOptions {
  SolveMethod method = SolveMethod::kAuto;
  FrictionLaw law = FrictionLaw::kCoulomb;  ///< kPgs knows kCoulomb only
  double tolerance =
      1e-9;  ///< on the largest contact residual [m/s], or on the sum that `stop` names
  int max_sweeps = 1000;  ///< >= 1; kAuto: of each of its stages
  /// kPerContact only. kGoldenSection minimizes an energy, so it knows kMaxDissipation only.
  SingleContactMethod single_contact = SingleContactMethod::kHalley;
  double single_contact_tolerance =
      0;               ///< kPerContact: [N s]; 0: a tenth of what `tolerance` asks for
  double alpha = 1.0;  ///< relaxation at the first sweep; kPgs: the constant factor of eq. 18 (0.6
                       ///< in the paper)
  double alpha_min = 0.7;  ///< kPerContact: where alpha decays to
  double gamma = 1.0;      ///< kPerContact: decay per sweep (0.99 in the paper); 1 keeps alpha
  StopTest stop =
      StopTest::kResidual;  ///< kPerContact and kPgs; the status looks at the residual in any case
  bool record_history = false;  ///< fill SolveResult::history
  void validate() const;        ///< throws ModelError that names the option
};

/// What a solve returns: the best impulse found, with its certificate.
struct SolveResult {
  std::vector<double> impulse;            ///< (3n) [N s]
  std::vector<double> velocity;           ///< G impulse + c (3n) [m/s]
  std::vector<double> contact_residuals;  ///< (n) [m/s]
  double residual = 0;                    ///< the largest of them [m/s]
  int sweeps = 0;                         ///< passes over all contacts
  int newton_steps = 0;                   ///< kAuto: of the finish and the fallback
  SolveStatus status = SolveStatus::kNotConverged;
  /// If recorded: the value of the stop test after each sweep; kAuto: the residual after each
  /// stage.
  std::vector<double> history;
};

/// Solves a problem; `warm_start` is empty or (3n). Throws only for bad input (see `validate`).
SolveResult solve(const ContactProblem& problem, const SolveOptions& options = {},
                  const std::vector<double>& warm_start = {});

/// Residual of each contact (n) [m/s]; a pure function of its arguments and the only definition of
/// "solved" in the project. Coulomb: De Saxce natural map with rho_i = 3 / trace(G_ii). Maximum
/// dissipation: |G_ii (lambda_i - local_i)|, where local_i is the exact single-contact solution
/// with the others held. Throws ModelError for bad input.
std::vector<double> residual(const ContactProblem& problem, const std::vector<double>& impulse,
                             FrictionLaw law = FrictionLaw::kCoulomb);

/// How to solve one contact.
struct SingleContactOptions {
  SingleContactMethod method = SingleContactMethod::kHalley;
  FrictionLaw law = FrictionLaw::kCoulomb;
  double tolerance =
      1e-10;  ///< kHalley: residual velocity relative to |c|; the others: impulse interval [N s]
};

/// The impulse of one contact, and what it took.
struct SingleContactResult {
  double impulse[3];      ///< x, y, z (normal) [N s]
  int evaluations = 0;    ///< of the gradient or energy; 0 when open or sticking
  bool converged = true;  ///< false: the method failed, or no finite impulse solves the contact
                          ///< (it jams); the impulse is the best point seen, always finite
};

/// Solves one contact: `delassus` row-major 3x3 [1/kg], `free_velocity` (3) [m/s], `friction`
/// >= 0 [1]. Throws ModelError for bad input.
SingleContactResult solve_contact(const double delassus[9], const double free_velocity[3],
                                  double friction, const SingleContactOptions& options = {});

}  // namespace stickslip
