#include "nn/mlp.h"

#include <cmath>
#include <type_traits>

namespace dbr {
namespace {

// Calls `function` with the pass that has the parameters' precision.
template <class Scalar, class Function>
decltype(auto) WithPass(const MlpParameters<Scalar>& parameters, MlpActivations<Scalar>* activations,
                        const Function& function) {
  if constexpr (std::is_same_v<Scalar, float>) {
    if (parameters.rounded != nullptr) return function(activations->reduced);
  }
  return function(activations->full);
}

}  // namespace

template <class Scalar>
const MatrixX<Scalar>& MlpForward(const MlpShape& shape, const MlpParameters<Scalar>& parameters,
                                  const ConstMatrixRef<Scalar>& x, MlpActivations<Scalar>* activations) {
  return WithPass(parameters, activations,
                  [&](auto& pass) -> const MatrixX<Scalar>& { return pass.Forward(shape, parameters, x); });
}

template <class Scalar>
void MlpParameterGradient(const MlpParameters<Scalar>& parameters, const ConstMatrixRef<Scalar>& x,
                          const ConstMatrixRef<Scalar>& dy, MlpActivations<Scalar>* activations,
                          VectorX<Scalar>* gradient) {
  WithPass(parameters, activations, [&](auto& pass) { pass.ParameterGradient(parameters, x, dy, gradient); });
}

template <class Scalar>
void MlpInputGradient(const MlpParameters<Scalar>& parameters, const ConstMatrixRef<Scalar>& dy,
                      Eigen::Index rows, MlpActivations<Scalar>* activations, MatrixX<Scalar>* dx) {
  WithPass(parameters, activations, [&](auto& pass) { pass.InputGradient(parameters, dy, rows, dx); });
}

template <class Scalar>
void MlpInputGradientOfDeltas(const MlpParameters<Scalar>& parameters, const ConstMatrixRef<Scalar>& dy,
                              MlpActivations<Scalar>* activations, MatrixX<Scalar>* dx) {
  WithPass(parameters, activations, [&](auto& pass) { pass.InputGradientOfDeltas(parameters, dy, dx); });
}

template <class Scalar>
VectorX<Scalar> InitialParameters(const MlpShape& shape, Rng& rng) {
  VectorX<Scalar> parameters(shape.parameter_count());
  for (int layer = 0; layer < shape.layer_count(); ++layer) {
    const double bound = 1.0 / std::sqrt(static_cast<double>(shape.in(layer)));
    const Eigen::Index end = shape.bias_offset(layer) + shape.out(layer);
    for (Eigen::Index i = shape.weight_offset(layer); i < end; ++i) {
      parameters[i] = static_cast<Scalar>(bound * (2.0 * rng.Uniform() - 1.0));
    }
    if (!shape.layer_norm() || layer + 1 == shape.layer_count()) continue;
    parameters.segment(shape.gain_offset(layer), shape.out(layer)).setOnes();
    parameters.segment(shape.shift_offset(layer), shape.out(layer)).setZero();
  }
  return parameters;
}

#define DBR_INSTANTIATE(Scalar)                                                                           \
  template const MatrixX<Scalar>& MlpForward<Scalar>(const MlpShape&, const MlpParameters<Scalar>&,       \
                                                     const ConstMatrixRef<Scalar>&,                       \
                                                     MlpActivations<Scalar>*);                            \
  template void MlpParameterGradient<Scalar>(const MlpParameters<Scalar>&, const ConstMatrixRef<Scalar>&, \
                                             const ConstMatrixRef<Scalar>&, MlpActivations<Scalar>*,      \
                                             VectorX<Scalar>*);                                           \
  template void MlpInputGradient<Scalar>(const MlpParameters<Scalar>&, const ConstMatrixRef<Scalar>&,     \
                                         Eigen::Index, MlpActivations<Scalar>*, MatrixX<Scalar>*);        \
  template void MlpInputGradientOfDeltas<Scalar>(const MlpParameters<Scalar>&,                            \
                                                 const ConstMatrixRef<Scalar>&, MlpActivations<Scalar>*,  \
                                                 MatrixX<Scalar>*);                                       \
  template VectorX<Scalar> InitialParameters<Scalar>(const MlpShape&, Rng&);

DBR_INSTANTIATE(float)
DBR_INSTANTIATE(double)
#undef DBR_INSTANTIATE

}  // namespace dbr
