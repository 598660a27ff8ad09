#include "solvers/large_system.h"

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseLU>

namespace stickslip::solvers {
namespace {

using Sparse = Eigen::SparseMatrix<double>;

/// Block of (C28): B_i G_ij + (A_i where i = j), from the block G_ji (G is symmetric).
Eigen::Matrix3d system_block(const double* A, const double* B, int i, int j, const double* g,
                             int stride) {
  using Rows = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  Rows g_ji;
  for (int r = 0; r < 3; ++r)
    for (int s = 0; s < 3; ++s) g_ji(r, s) = g[r * stride + s];
  Eigen::Matrix3d block = Eigen::Map<const Rows>(B + 9L * i) * g_ji.transpose();
  if (i == j) block += Eigen::Map<const Rows>(A + 9L * i);
  return block;
}

/// Column by column, which the symmetric pattern gives for nothing: column j has the rows of row j.
Sparse assemble_sparse(const contact::ExplicitProblem& p, const Integers& active, const double* A,
                       const double* B) {
  const int n = int(active.size());
  std::vector<int> place(p.n, -1);
  for (int a = 0; a < n; ++a) place[active[a]] = a;
  Sparse m(3 * n, 3 * n);
  Eigen::VectorXi counts(3 * n);
  for (int a = 0; a < n; ++a) {
    int blocks = 0;
    contact::for_each_block(p, active[a],
                            [&](int j, const double*, int) { blocks += place[j] >= 0; });
    counts.segment<3>(3 * a).setConstant(3 * blocks);
  }
  m.reserve(counts);
  for (int a = 0; a < n; ++a)
    contact::for_each_block(p, active[a], [&](int i, const double* g, int stride) {
      if (place[i] < 0) return;
      const Eigen::Matrix3d block = system_block(A, B, i, active[a], g, stride);
      for (int s = 0; s < 3; ++s)
        for (int r = 0; r < 3; ++r) m.insert(3 * place[i] + r, 3 * a + s) = block(r, s);
    });
  m.makeCompressed();
  return m;
}

Eigen::MatrixXd assemble_full(const contact::ExplicitProblem& p, const Integers& active,
                              const double* A, const double* B) {
  const int n = int(active.size());
  Eigen::MatrixXd m(3 * n, 3 * n);
  for (int a = 0; a < n; ++a)
    for (int b = 0; b < n; ++b) {
      const double* g = p.row(3 * active[a]) + 3 * active[b];
      m.block<3, 3>(3 * b, 3 * a) = system_block(A, B, active[b], active[a], g, 3 * p.n);
    }
  return m;
}

}  // namespace

struct LargeSystem::Factors {
  bool is_sparse = false;
  Eigen::SparseLU<Sparse> sparse;
  Eigen::PartialPivLU<Eigen::MatrixXd> full;
};

LargeSystem::LargeSystem() : factors_(std::make_unique<Factors>()) {}
LargeSystem::~LargeSystem() = default;

bool LargeSystem::factor(const contact::ExplicitProblem& p, const Integers& active, const double* A,
                         const double* B) {
  Factors& f = *factors_;
  f.is_sparse = p.starts != nullptr;
  if (!f.is_sparse) {
    f.full.compute(assemble_full(p, active, A, B));
    return true;
  }
  f.sparse.compute(assemble_sparse(p, active, A, B));
  return f.sparse.info() == Eigen::Success;
}

void LargeSystem::solve(double* x) {
  Factors& f = *factors_;
  const Eigen::Index m = f.is_sparse ? f.sparse.rows() : f.full.rows();
  Eigen::Map<Eigen::VectorXd> to(x, m);
  const Eigen::VectorXd right = to;
  to = f.is_sparse ? Eigen::VectorXd(f.sparse.solve(right)) : Eigen::VectorXd(f.full.solve(right));
}

bool is_definite(const contact::ExplicitProblem& p, double shift) {
  Integers all(p.n);
  std::vector<double> A(9L * p.n), B(9L * p.n);
  for (int i = 0; i < p.n; ++i) {
    all[i] = i;
    for (int r = 0; r < 3; ++r) A[9L * i + 4 * r] = shift, B[9L * i + 4 * r] = 1;
  }
  if (!p.starts)
    return Eigen::LLT<Eigen::MatrixXd>(assemble_full(p, all, A.data(), B.data())).info() ==
           Eigen::Success;
  const Eigen::SimplicialLDLT<Sparse> factors(assemble_sparse(p, all, A.data(), B.data()));
  return factors.info() == Eigen::Success && factors.vectorD().minCoeff() > 0;
}

}  // namespace stickslip::solvers
