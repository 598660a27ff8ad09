// One scene: gravity, a ground plane, robots. Double precision, one thread.
//
// A robot only meets the ground in this version, so every robot is a contact problem of its own and
// is stepped on its own.
#pragma once
#include <stickslip/contact.h>
#include <stickslip/model.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace stickslip {

/// How a step moves the state (docs/theory/step.md).
enum class Integrator {
  kEnergySafe,  ///< kick, projected drift, position correction at the new configuration, substeps;
                ///< the default
  kSemiImplicit,  ///< the paper's: semi-implicit Euler, a contact is active when its gap is
                  ///< negative, no correction
};

/// Contact law of a pair of materials.
struct MaterialPair {
  double friction = 0.8;             ///< Coulomb's coefficient [1], >= 0
  double restitution = 0;            ///< Newton's, 0..1 [1]
  double restitution_threshold = 0;  ///< approach speed below which a contact does not bounce [m/s]
};

/// How the contact impulses of a step are found.
struct StepSolverOptions {
  SolveMethod method = SolveMethod::kAuto;  ///< kPgs: law kCoulomb only
  FrictionLaw law = FrictionLaw::kCoulomb;
  SingleContactMethod single_contact = SingleContactMethod::kHalley;  ///< kPerContact only
  double tolerance = 1e-9;  ///< absolute part of the stopping test [m/s]; kAuto: of what a sweep
                            ///< changes or, at the defaults or above, the next one is expected
                            ///< to; and, at every third sweep, of the residual
  double relative_tolerance = 1e-8;  ///< kAuto: part of the largest contact speed [1]
  int max_sweeps = 100'000;          ///< kPerContact, kPgs
  double alpha = 1.0, alpha_min = 0.7,
         gamma = 0.99;     ///< kPerContact, kPgs (alpha only); see SolveOptions
  bool warm_start = true;  ///< start at the impulses of the last step; kAuto with kSemiImplicit:
                           ///< where those of the last two point
};

/// Options of a world; fixed once it is made.
struct WorldOptions {
  double time_step = 1e-3;       ///< [s]
  Vector3 gravity{0, 0, -9.81};  ///< [m/s^2]
  Integrator integrator = Integrator::kEnergySafe;
  StepSolverOptions solver;  ///< how contact impulses are found
  int max_substeps =
      8;  ///< kEnergySafe: a step is cut into at most this many parts when bodies turn fast
  void validate() const;  ///< throws ModelError that names the option
};

/// Where and how a robot is added.
struct RobotOptions {
  std::string name;           ///< empty: the model's name, made unique
  Vector3 position{0, 0, 0};  ///< of the base [m]; of a fixed base too
  std::array<double, 4> orientation{1, 0, 0,
                                    0};  ///< of the base, w x y z; normalized on the way in
  std::string material = "default";      ///< of shapes that name none; see set_material_pair
};

/// Bits a step reports. Nothing is dropped silently.
enum class StepStatus : std::uint32_t {
  kOk = 0,
  kNotConverged = 1,  ///< cause: contact solve above its tolerance; the best impulse was used, see
                      ///< residual; remedy: smaller step
  kNonFinite = 2,     ///< cause: forces or velocities overflowed; the robot was left in its last
                      ///< finite state; remedy: smaller step or forces
};

/// One contact point of the last step.
struct Contact {
  int robot;         ///< index in the world
  int body;          ///< of the robot's model
  int shape;         ///< of the robot's model
  int point;         ///< of the shape (a box has 8 corners)
  Vector3 position;  ///< world [m], at the start of the step
  Vector3 normal;    ///< world, from the ground to the robot
  double gap;        ///< at the start of the step [m], negative where they overlap
  double friction;   ///< [1]
  Vector3 impulse;   ///< on the robot, world axes [N s], of the last substep
  Vector3 velocity;  ///< after the impulse, world axes [m/s]
};

/// What the last step did for one robot (its last substep, where there were several).
struct StepInfo {
  StepStatus status = StepStatus::kOk;
  int contacts = 0;      ///< candidates in the solve
  int sweeps = 0;        ///< passes over all contacts
  int newton_steps = 0;  ///< of the solver's finish and fallback; kAuto only
  int substeps = 1;      ///< kEnergySafe: parts the step was cut into
  double residual = 0;   ///< largest contact residual [m/s]; infinite where a problem was refused
                         ///< because it is not finite
};

/// Seconds spent per stage since the last reset; only counted while `World::set_profiling(true)`.
struct StageTimes {
  double dynamics = 0;   ///< kinematics, bias, mass matrix factor, free velocity
  double detection = 0;  ///< candidates and gaps
  double delassus = 0;   ///< rows Y and the contact problem
  double solve = 0;      ///< contact impulses
  double integrate = 0;  ///< final velocity, drift, position correction
  long steps = 0;        ///< time steps counted
};

class World;
class Batch;

/// A robot in a world, made by `World::add_robot`. References stay valid as long as the world.
/// Functions with an `out` throw ModelError where it has the wrong length; those that take a frame
/// name throw ModelError that lists the names.
class Robot {
 public:
  ~Robot();
  const std::string& name() const;  ///< in its world
  const Model& model() const;
  ModelPtr model_ptr() const;  ///< the same model, shared
  double time() const;         ///< of its state [s]

  std::span<const double> q() const;  ///< (nq), see Model
  std::span<const double> u() const;  ///< (nu), see Model
  /// Sets position and velocity and forgets warm start and integrator history. Throws ModelError
  /// for wrong lengths, NaN or a quaternion that is not near unit length (it is normalized).
  void set_state(std::span<const double> q, std::span<const double> u);

  /// Generalized force [N, N m] (nu), kept until changed. Throws ModelError for a wrong length or
  /// NaN.
  void set_generalized_force(std::span<const double> tau);
  std::span<const double> generalized_force() const;  ///< (nu) [N, N m], order and axes of u
  /// Joint PD control tau = kp (target - q) - kd u, taken implicitly in the rates so that no gain
  /// is too stiff for the step. kp [N m/rad or N/m], kd [N m s/rad or N s/m] (joints), >= 0. Throws
  /// ModelError for a wrong length, NaN or a negative gain.
  void set_pd_gains(std::span<const double> kp, std::span<const double> kd);
  std::span<const double> pd_kp() const;               ///< (joints)
  std::span<const double> pd_kd() const;               ///< (joints)
  void set_pd_target(std::span<const double> target);  ///< (joints) [rad or m]
  std::span<const double> pd_target() const;           ///< (joints) [rad or m]

  void mass_matrix(std::span<double> out) const;  ///< row-major (nu, nu) [kg, kg m, kg m^2]
  /// h in M du/dt + h = tau: gravity, Coriolis and centrifugal forces (nu) [N, N m]. Without
  /// damping and control.
  void bias_force(std::span<double> out) const;
  /// Accelerations du/dt (nu) [m/s^2, rad/s^2] without contacts, for generalized forces tau (nu)
  /// [N, N m].
  void forward_dynamics(std::span<const double> tau, std::span<double> out) const;
  /// Rows 0-2: velocity of the frame's origin, rows 3-5: angular velocity, world axes; row-major
  /// (6, nu).
  void jacobian(const std::string& frame, std::span<double> out) const;
  Pose frame_pose(const std::string& frame) const;  ///< in the world
  double kinetic_energy() const;                    ///< [J]
  double potential_energy() const;                  ///< [J], zero at the world's origin
  /// Kinetic plus potential energy at the time of q, as the integrator accounts for it [J]. While
  /// in contact, u of the energy-safe integrator lacks half a step of gravity; this adds it.
  /// Contacts never make it grow.
  double mechanical_energy() const;
  Vector3 center_of_mass() const;    ///< [m]
  Vector3 linear_momentum() const;   ///< [kg m/s]
  Vector3 angular_momentum() const;  ///< about the center of mass [kg m^2/s]
  /// G = J M^-1 J^T (3n, 3n) row-major [1/kg] of n points fixed to bodies; points in world axes
  /// [m].
  void delassus(std::span<const int> bodies, std::span<const Vector3> points,
                std::span<double> out) const;

  const StepInfo& info() const;               ///< of the last step
  std::span<const Contact> contacts() const;  ///< of the last step

 private:
  friend class World;
  struct Impl;
  explicit Robot(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Gravity, a ground, robots. Belongs to one thread at a time.
class World {
 public:
  explicit World(const WorldOptions& options = {});  ///< throws ModelError for bad options
  ~World();
  World(World&&) noexcept;
  World& operator=(World&&) noexcept;

  /// A horizontal plane that fills everything below z = height [m]. Throws ModelError for
  /// a second one or a height that is not finite.
  void add_ground(double height = 0, const std::string& material = "default");
  /// Adds a robot at its zero configuration (base as the options say), at rest. Throws ModelError
  /// for a null model, a name that is taken or a pose that is not finite; the world is then as it
  /// was.
  Robot& add_robot(ModelPtr model, const RobotOptions& options = {});
  /// Sets how two materials meet, in either order, now and for what is added later. Throws
  /// ModelError for values out of range.
  void set_material_pair(const std::string& a, const std::string& b, const MaterialPair& pair);

  int num_robots() const;
  Robot& robot(int index);  ///< in the order of adding; throws ModelError if there is none
  const Robot& robot(int index) const;
  double time() const;  ///< [s]
  const WorldOptions& options() const;

  /// Advances every robot by `steps` time steps; returns the status bits of all of them, or-ed.
  /// Never throws for what happens in a step; ModelError for a negative number.
  StepStatus step(int steps = 1);

  /// Everything that changes in a step, as bytes; `load_state` replays bit for bit. Throws
  /// ModelError if the blob is not of a world with the same robots.
  std::vector<std::uint8_t> save_state() const;
  void load_state(std::span<const std::uint8_t> blob);

  /// The explicit contact problem that the next step of a robot would solve in its last substep (no
  /// contacts: empty). Forgets the contacts of the last step.
  ContactProblem next_contact_problem(int robot);
  /// The explicit contact problem that the last step of a robot solved (its last substep, where
  /// there were several) and, if asked for, the impulses it found (3n) [N s]. Empty without
  /// contacts.
  ContactProblem last_contact_problem(int robot, std::vector<double>* impulse = nullptr) const;

  void set_profiling(bool on);  ///< counts the time of each stage from now on, a little slower
  const StageTimes& stage_times() const;  ///< since the last reset
  void reset_stage_times();

 private:
  friend class Batch;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stickslip
