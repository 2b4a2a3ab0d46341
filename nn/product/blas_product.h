// Matrix products into memory that is overwritten, by OpenBLAS. Eigen's own expression zeroes its result
// first and then adds to it, which costs a pass over the memory.
#pragma once

#include <cblas.h>

#include <type_traits>

#include "core/batch.h"
#include "core/check.h"

namespace dbr {

// A matrix in column-major memory that somebody else owns.
template <class Scalar>
struct Operand {
  const Scalar* values;
  Eigen::Index rows;
  Eigen::Index cols;
  Eigen::Index stride;      // from one stored column to the next
  bool transposed = false;  // stored as [cols x rows]
};

// The same memory read as the transposed matrix.
template <class Scalar>
Operand<Scalar> Transposed(const Operand<Scalar>& a) {
  return {a.values, a.cols, a.rows, a.stride, !a.transposed};
}

// c [a.rows x b.cols] = a b, c column-major with `stride` from column to column. Single and double precision.
template <class Scalar>
void Product(const Operand<Scalar>& a, const Operand<Scalar>& b, Scalar* c, Eigen::Index stride) {
  DBR_CHECK(a.cols == b.rows);
  const auto order = [](const Operand<Scalar>& x) { return x.transposed ? CblasTrans : CblasNoTrans; };
  const auto size = [](Eigen::Index n) { return static_cast<blasint>(n); };
  const auto run = [&](auto gemm) {
    gemm(CblasColMajor, order(a), order(b), size(a.rows), size(b.cols), size(a.cols), Scalar{1}, a.values,
         size(a.stride), b.values, size(b.stride), Scalar{0}, c, size(stride));
  };
  // A row: b^T a^T reads b once, where the general product would first copy it.
  if (a.rows == 1 && !a.transposed && stride == 1) {
    const auto row = [&](auto gemv) {
      gemv(CblasColMajor, b.transposed ? CblasNoTrans : CblasTrans, size(b.transposed ? b.cols : b.rows),
           size(b.transposed ? b.rows : b.cols), Scalar{1}, b.values, size(b.stride), a.values,
           size(a.stride), Scalar{0}, c, 1);
    };
    if constexpr (std::is_same_v<Scalar, float>) {
      row(cblas_sgemv);
    } else {
      row(cblas_dgemv);
    }
    return;
  }
  if constexpr (std::is_same_v<Scalar, float>) {
    run(cblas_sgemm);
  } else {
    run(cblas_dgemm);
  }
}

}  // namespace dbr
