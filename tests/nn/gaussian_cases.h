// What the tests of the continuous losses' basic functions share: random Gaussians, and the cases of the
// reference values.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "core/rng.h"
#include "nn/gaussian.h"
#include "tests/support/numeric.h"
#include "tests/support/reference_json.h"

namespace dbr {

inline MatrixX<double> Normals(Eigen::Index rows, Eigen::Index cols, Rng& rng) {
  return MatrixX<double>::NullaryExpr(rows, cols, [&] { return rng.Normal(); });
}

struct Gaussian {
  MatrixX<double> mean, log_std;

  GaussianView<double> view() const { return {mean, log_std}; }
};

inline Gaussian RandomGaussian(Eigen::Index rows, Eigen::Index cols, Rng& rng) {
  return {Normals(rows, cols, rng), 0.5 * Normals(rows, cols, rng)};
}

// Runs `check` on every case of `key` in every losses*.json that has some.
inline void ForEachCase(const std::string& key, const std::function<void(const nlohmann::json&)>& check) {
  std::size_t cases = 0;
  for (const ReferenceFile& file : ReferenceFiles("losses", "losses")) {
    ASSERT_TRUE(file.json.is_object()) << file.name << " is not a JSON object";
    if (!file.json.contains(key)) continue;
    for (const nlohmann::json& c : file.json[key]["cases"]) {
      SCOPED_TRACE(file.name + ": " + key + " " + std::to_string(cases++));
      check(c);
    }
  }
  EXPECT_GT(cases, 0u) << "no " << key << " in " << ReferenceDir() / "losses" / "losses*.json";
}

}  // namespace dbr
