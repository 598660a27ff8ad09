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

/// Method for several contacts (docs/theory/solvers.md, sections 1 to 7).
enum class SolveMethod {
  kAuto,           ///< the chain: sweeps, Newton steps, interior point, ADMM; the default
  kPerContact,     ///< [Hwangbo 2018] Algorithm 2
  kPgs,            ///< projected Gauss-Seidel, [Hwangbo 2018] eq. 17, 18
  kProxNewton,     ///< proximal point method with semismooth Newton steps, [Alart 1991]
  kInteriorPoint,  ///< primal-dual interior point on the friction cones, [Acary 2024]
  kAdmm,           ///< alternating directions with De Saxce's shift, [Carpentier 2024]
};

/// How interior-point steps treat De Saxce's shift mu |v_T|, what makes Coulomb's law more than a
/// convex problem.
enum class ShiftRule {
  kLagged,  ///< from the last iterate: every step is one of a convex problem
  kDamped,  ///< half way from the last one: where lagging oscillates (large friction)
  kExact,   ///< linearized: fastest near a solution, may stop far from one
};

/// What found the impulse that a solve returns.
enum class SolveStage {
  kStart,          ///< the warm start, or rest
  kSweeps,         ///< per-contact sweeps or PGS
  kNewton,         ///< Newton finish of the sweeps
  kProxNewton,     ///< proximal Newton steps
  kInteriorPoint,  ///< interior point
  kAdmm,           ///< ADMM
};

/// How a solve ended. Whatever the status, the impulse returned is the best one met, inside its
/// cones (settled on them where the residual stays within the tolerance), and the certificate says
/// how good it is.
enum class SolveStatus {
  /// Cause: the residual is at most the tolerance. Consequence: under Coulomb's law the impulse is
  /// the exact answer to a problem whose contact velocities differ by the certificate's backward
  /// error. Remedy: none needed.
  kConverged,
  /// Cause: a method chosen by name used up max_sweeps or max_iterations. Consequence: the laws
  /// hold up to the residual only. Remedy: raise the limit, or use kAuto.
  kIterationLimit,
  /// Cause: the method, or every stage of kAuto, saw no way on above the tolerance: it lies below
  /// the rounding of the problem, or friction jams (Painleve) and no finite impulse exists, or the
  /// problem is too hard. Consequence: as above. Remedy: kAuto; compare the residual with 1e-16
  /// times the largest G_ii |lambda_i|; check friction and geometry; in a simulation halve the
  /// step.
  kStalled,
  /// Cause: a contact cannot push (G_zz near 0: its body is held along the normal) and is driven
  /// in.
  /// Consequence: no impulse keeps it from sinking; all other contacts are solved as far as the
  /// residuals say. Remedy: drop the contact, or let its body move.
  kInfeasible,
};

/// What ends the sweeps of kPerContact and kPgs, once it is at most the tolerance.
enum class StopTest {
  kResidual,      ///< the largest contact residual [m/s]
  kViolationSum,  ///< what each contact violates of its law, added [m/s]: the paper's for
                  ///< kPerContact
  kUpdateSum,  ///< impulse updates [N s] and penetration velocities [m/s], added: the paper's for
               ///< kPgs
};

/// A contact problem, dense or block sparse. Dense: `delassus` is row-major (3n, 3n). Block sparse
/// (where `block_starts` is not empty): `delassus` holds k blocks, each row-major (3, 3), both
/// triangles, in the layout of SciPy's BSR with sorted columns; blocks that are not stored are
/// zero.
struct ContactProblem {
  std::vector<double> delassus;       ///< (3n, 3n) or (k, 3, 3), symmetric semidefinite [1/kg]
  std::vector<double> free_velocity;  ///< (3n) [m/s]
  std::vector<double> friction;  ///< (n) [1], not negative; infinite and huge values count as 1e4
  std::vector<int> block_starts{};  ///< (n + 1): blocks of row i are starts[i] .. starts[i + 1] - 1
  std::vector<int> block_columns{};  ///< (k): column of each block, ascending within a row
  /// n, as many as `friction` has.
  int num_contacts() const { return static_cast<int>(friction.size()); }
  bool is_block_sparse() const { return !block_starts.empty(); }
  /// Throws ModelError that names the argument and its first offending index (lengths, NaN,
  /// asymmetry, negative diagonal, indefinite matrix, negative friction, indices of blocks).
  void validate() const;
};

/// How to solve a problem, and how far.
struct SolveOptions {
  SolveMethod method = SolveMethod::kAuto;
  FrictionLaw law = FrictionLaw::kCoulomb;  ///< kPgs knows kCoulomb only
  /// On the largest contact residual [m/s], or on the sum that `stop` names; not negative.
  double tolerance = 1e-9;
  /// Added to it: this much of the largest |free velocity|; not negative. One of the two is
  /// positive.
  double relative_tolerance = 0;
  int max_sweeps = 1000;   ///< >= 1; kAuto: of each of its sweep stages
  int max_iterations = 0;  ///< Newton, interior-point or ADMM steps of a method chosen by name, >=
                           ///< 0; 0: 500, 100 or 5000
  /// Redundant contacts leave a choice of impulses with the same velocity (feet that press against
  /// each other, copies of a contact): spread them over the contacts at rest by least norm, then,
  /// with the normal impulses held, take the least tangential ones, (C70). Where the problem is
  /// solved, island by island of up to 500 contacts. kCoulomb only.
  bool minimum_norm = false;
  /// kProxNewton: proximal weight of the first subproblem, relative to G_ii; > 0.
  double proximal_weight = 1e-3;
  ShiftRule shift = ShiftRule::kExact;  ///< kInteriorPoint
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

/// How good an impulse is, from the problem and the impulse alone (docs/theory/solvers.md, section
/// 8). Velocities are v = G impulse + c.
struct Certificate {
  std::vector<double> residuals;        ///< (n) residual of each contact [m/s], see `residual`
  std::vector<double> backward_errors;  ///< (n) the least change of the contact's velocity that
                                        ///< makes its impulse exact under Coulomb's law [m/s]
  double residual = 0;                  ///< the largest [m/s]
  double backward_error = 0;            ///< the largest [m/s]
  double penetration_speed = 0;         ///< the largest -v_z, or 0 [m/s]
  double cone_violation = 0;            ///< the largest |lambda_T| - mu lambda_z, or 0 [N s]
  /// The largest angle between the friction of a sliding contact and the direction against its
  /// sliding [rad]; contacts slower than 1e-6 of the largest |c|, or that hardly push, do not
  /// count.
  double direction_error = 0;
  double power = 0;  ///< the largest |lambda . (v + mu |v_T| z)|, zero at a solution [J]
};

/// One point of a solve's history.
struct HistoryEntry {
  SolveStage stage;
  double time;      ///< since the solve began [s]
  double residual;  ///< of the impulse at that point, projected on its cones [m/s]
};

/// What a solve returns: the best impulse found, with its certificate.
struct SolveResult {
  std::vector<double> impulse;   ///< (3n) [N s]
  std::vector<double> velocity;  ///< G impulse + c (3n) [m/s]
  Certificate certificate;
  SolveStage stage = SolveStage::kStart;  ///< what found it
  int sweeps = 0;                         ///< passes over all contacts
  int newton_steps = 0;                   ///< of the Newton finish and of proximal Newton
  int interior_point_steps = 0;
  int admm_iterations = 0;
  SolveStatus status = SolveStatus::kStalled;
  /// If recorded: one entry per start, sweep, Newton or interior-point step, ADMM iteration; of
  /// islands that are solved apart, one entry each.
  std::vector<HistoryEntry> history;
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

/// Certificate of any impulse (3n); a pure function of its arguments. Throws ModelError for bad
/// input.
Certificate certify(const ContactProblem& problem, const std::vector<double>& impulse,
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
