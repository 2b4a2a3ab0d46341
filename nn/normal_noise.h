// Standard normal noise for whole matrices.
#pragma once

#include "core/batch.h"
#include "core/rng.h"

namespace dbr {

// Fills `noise` [rows x cols] with independent standard normal numbers. A loss takes its noise as an
// argument. Box and Muller's method, both of its numbers used, one number of the stream for two of the noise.
// The uniform numbers have 32 bits, so that the noise stays within +-6.7. Float and double.
template <class Scalar>
void FillNormal(Rng& rng, Eigen::Index rows, Eigen::Index cols, MatrixX<Scalar>* noise);

}  // namespace dbr
