// Factorises dense fronts: one step of the elimination, the same for the cells of a tile and for the nodes of the merge
// tree.
//
// A front holds the normal equations K x = b of the unknowns E, which are eliminated here, and of the separator P,
// whose equations go to the parent. It stands for the quadratic form of the residuals below its node,
//
//     q(x) = 1/2 x'K x - b'x,    K = | K_EE   .   |   b = | b_E |
//                                    | K_PE  K_PP |,      | b_P |.
//
// With K_EE = L L', Y = K_PE L^-T and z = L^-1 b_E (blocked Cholesky), the minimum over x_E is again a quadratic form,
// now of x_P alone: min q = 1/2 x_P'S x_P - s'x_P - 1/2 |z|^2. Its matrix S is the Schur complement of K_EE, and it is
// the update matrix that goes to the parent:
//
//     S = K_PP - Y Y',   s = b_P - Y z.
//
// The parent adds the forms of its children, which is exact: nothing is approximated on the way to the root. This is
// Helmert's blocking (1880) along a tree. In the literature on sparse matrices it is nested dissection (A. George, SIAM
// J. Numer. Anal. 10(2), 1973) by the multifrontal method (I. Duff, J. Reid, ACM TOMS 9(3), 1983).
//
// The square of the Newton decrement b'K^-1 b of the whole block is the sum of |z|^2 over all nodes and points, so each
// front adds its |z|^2. On the way down x_E = L^-T (z - Y' x_P).
//
// Damping: (J'J + lambda D) x = b with D = diag(J'J) (Marquardt 1963). The diagonal of K is smaller than D once
// children have been eliminated, because S = K_PP - Y Y'. D therefore goes up the tree next to the matrices. Each
// unknown is damped once, at the node that eliminates it, where the D of all residuals with this unknown is complete.
//
// A pivot below 1e-12 of the diagonal of J'J before the elimination (of the damped diagonal when lambda > 0) marks a
// direction that the observations do not determine. Without damping the ratio is the squared sine of the angle between
// the column of J and the space of the columns eliminated before it. The scalar unknown of the pivot is held (x = 0, a
// minimal constraint) and reported. In the formulas above, its row and column of L become those of the identity, and
// its rows of z and columns of Y become zero.
//
// Sign: b = -J'r, so that x is the step. Right-hand side 0 is b; a free block adds further ones for its inner
// constraints. The result of every function depends on its inputs alone, and children are added in their order, so that
// the bits are always the same.
#pragma once

#include <cstdint>
#include <vector>

#include "merge/plan/unknowns.h"
#include "merge/scratch/bytes.h"

namespace megablock {

inline constexpr double kPivotTolerance = 1e-12;

// A scalar unknown that was held because its pivot vanished.
struct HeldUnknown {
  UnknownId id;
  std::int64_t component = 0;  // row inside the unknown
  double ratio = 0;            // pivot / diagonal before the elimination; 0 / 0 counts as 0
};

// Sums over a subtree besides the matrices. All of them are additive. They travel with the update, so that the root has
// the sums of the whole block.
struct SubtreeSums {
  double cost = 0;                // 1/2 sum rho(|r|^2)
  double weighted_squares = 0;    // sum rho' |r|^2
  double decrement_squared = 0;   // sum |L^-1 b|^2 over everything eliminated so far, points included
  std::int64_t residuals = 0;     // scalar residuals
  std::int64_t observations = 0;  // image observations among them
  std::int64_t points = 0;
  std::int64_t unknowns = 0;     // scalar unknowns eliminated; points and held unknowns count too
  std::int64_t held_points = 0;  // scalar unknowns of points held for a vanishing pivot
  std::vector<HeldUnknown> held;
  void add(const SubtreeSums& other);  // in the order of the calls
};

// The decrease of x'Sx - 2 b'x from x = 0 to its minimum, b'S^+ b, and the rank of S. The value is twice the decrease
// of the cost, as a chi-square wants it.
struct LeastSquares {
  double value = 0;
  std::int64_t rank = 0;
};

// The update of a child: its normal equations, condensed on its separator unknowns.
struct UpdateMatrix {
  UnknownList unknowns;  // separator unknowns, ascending
  std::int64_t right_hand_sides = 1;
  std::vector<double> matrix;  // lower triangle column by column, packed: n (n + 1) / 2
  std::vector<double> rhs;     // [n x right_hand_sides], column-major
  // [n] diagonal of J'J before the elimination, of the whole subtree; lambda multiplies it
  std::vector<double> diagonal;
  SubtreeSums sums;
  LeastSquares alone;  // of these equations alone; filled in where seams are checked (seam_check.h)

  std::int64_t byte_count() const;  // of its values
  void write(ByteWriter& out) const;
  static UpdateMatrix read(ByteReader& in);  // throws StoreError
  Bytes to_bytes() const;
  static UpdateMatrix from_bytes(const Bytes& bytes);
};

// The factors of an eliminated front, for back-substitution and covariances.
struct FrontFactor {
  UnknownList eliminated, separator;  // each ascending
  std::int64_t right_hand_sides = 1;
  std::vector<double> factor;      // [(e + p) x e] column-major: L (lower triangle) above Y
  std::vector<double> z;           // [e x right_hand_sides]
  std::vector<std::int64_t> held;  // rows of held unknowns in E

  std::int64_t byte_count() const;
  void write(ByteWriter& out) const;
  static FrontFactor read(ByteReader& in);  // throws StoreError
};

// Values of a list of unknowns, such as a step of the adjustment. Frames and mounts have a rotation (radians) and a
// position (metres); increments are those of geometry/transform/rotation.h. Column 0 answers the right-hand side b, the
// further ones answer those of the inner constraints.
struct Step {
  UnknownList unknowns;  // ascending
  std::int64_t columns = 1;
  std::vector<double> values;  // [n x columns], column-major

  const double* find(const UnknownId& id, std::int64_t column = 0) const;  // nullptr when absent
  Step restricted_to(const UnknownList& wanted) const;                     // throws ComputeError when one is missing
  Bytes bytes_of(const UnknownList& wanted) const { return restricted_to(wanted).to_bytes(); }
  Bytes to_bytes() const;
  static Step from_bytes(const Bytes& bytes);
};

// A dense symmetric matrix over a list of unknowns (covariances).
struct CovarianceMatrix {
  UnknownList unknowns;        // ascending
  std::vector<double> matrix;  // [n x n], column-major, full

  CovarianceMatrix restricted_to(const UnknownList& wanted) const;
  // Copies the block (row unknown, column unknown) to `out` (column-major, with as many rows as the row unknown).
  bool block(const UnknownId& row, const UnknownId& column, double* out) const;
  Bytes to_bytes() const;
  static CovarianceMatrix from_bytes(const Bytes& bytes);
};

// Keeps the memory of small fronts for the next ones. To get it anew from the system would cost as much time as their
// arithmetic.
class FrontMemory {
 public:
  // An empty vector with a capacity of at least `size` values.
  std::vector<double> take(std::size_t size);
  void give(std::vector<double> buffer);

 private:
  std::vector<std::vector<double>> free_;  // ascending by capacity
};

// A front that is being filled. The rows of the eliminated unknowns come first, those of the separator unknowns follow.
// The columns of the two are stored apart, so that the first become the factor without a copy. Only the lower triangle
// is used. Of the columns of P only the rows of P are stored, because the rows of E above them are in the columns of E.
class Front {
 public:
  // `memory` may be null; otherwise it outlives the front. Throws ComputeError for more unknowns than a front may have.
  Front(UnknownList eliminated, UnknownList separator, std::int64_t right_hand_sides = 1,
        FrontMemory* memory = nullptr);

  std::int64_t dimension() const { return dimension_; }
  std::int64_t row_of(const UnknownId& id) const;  // first row; -1 when the unknown is not in the front
  // A block of the lower triangle whose columns belong to one unknown: its first element, and the distance between
  // columns.
  struct Place {
    double* values;
    std::int64_t stride;
  };
  Place place(std::int64_t row, std::int64_t column) {
    const std::int64_t e = eliminated_dimension_, p = dimension_ - e;
    if (column < e) return {factor_.data() + row + column * dimension_, dimension_};
    return {update_.data() + (row - e) + (column - e) * p, p};
  }
  double* factor() { return factor_.data(); }  // columns of E [n x e], stored n values apart
  double* update() { return update_.data(); }  // columns of P, with the rows of P alone [p x p]
  std::int64_t eliminated_dimension() const { return eliminated_dimension_; }
  double* rhs() { return rhs_.data(); }            // [n x right_hand_sides]
  double* diagonal() { return diagonal_.data(); }  // [n] diagonal of J'J
  SubtreeSums& sums() { return sums_; }

  void add(const UpdateMatrix& child);  // extend-add; leaves out right-hand sides that this front does not have

  struct Result;
  // Adds lambda * diagonal to the eliminated rows and factorises them. Returns the update and the factors. The front
  // cannot be used afterwards. Its eliminated columns become the factor without a copy; the update is packed.
  Result eliminate(double lambda) &&;

 private:
  UnknownList eliminated_, separator_;
  std::vector<std::int64_t> eliminated_rows_, separator_rows_;
  std::int64_t dimension_ = 0, eliminated_dimension_ = 0, right_hand_sides_ = 1;
  std::vector<double> factor_;  // [n x e]
  std::vector<double> update_;  // [p x p]
  std::vector<double> rhs_, diagonal_;
  FrontMemory* memory_;
  SubtreeSums sums_;
};

struct Front::Result {
  UpdateMatrix update;
  FrontFactor factor;
};

// The values of E and P, ascending, from values that include those of P.
Step back_substitute(const FrontFactor& factor, const Step& separator);

// The covariance of the unknowns E and P of a front, in three blocks. The whole matrix of a large front is never
// formed.
struct FrontCovariance {
  UnknownList eliminated, separator;  // each ascending
  std::vector<double> inner;          // C_EE [e x e] column-major, lower triangle
  std::vector<double> cross;          // C_PE [p x e]
  std::vector<double> outer;          // C_PP [p x p]

  CovarianceMatrix restricted_to(const UnknownList& wanted) const;  // throws ComputeError when one is missing
  Bytes bytes_of(const UnknownList& wanted) const;                  // bytes of restricted_to(), without forming it
  CovarianceMatrix whole() const;                                   // of E and P, ascending
};

// The covariance of a front from that of P, which has all unknowns of P and no others: C_EE = K_EE^-1 + K_EE^-1 K_EP
// C_PP K_PE K_EE^-1, C_PE = -C_PP K_PE K_EE^-1. Held unknowns get zero rows.
FrontCovariance covariance_down(const FrontFactor& factor, CovarianceMatrix separator);

}  // namespace megablock
