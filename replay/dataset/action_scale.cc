#include "replay/dataset/action_scale.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/json_text.h"

namespace dbr {
namespace {

using nlohmann::json;

constexpr double kUnbounded = 1e300;  // stands for Infinity, which is no JSON, though Python writes it

// The numbers of a bound: a list, or one number for a space without dimensions.
std::optional<std::vector<double>> Numbers(const json& space, const char* key) {
  const auto bound = space.find(key);
  if (bound == space.end()) return std::nullopt;
  const json list = bound->is_array() ? *bound : json::array({*bound});
  std::vector<double> numbers;
  for (const json& number : list) {
    if (!number.is_number()) return std::nullopt;
    numbers.push_back(number.get<double>());
  }
  return numbers;
}

// Empty where the bounds say where -1 and 1 are.
std::string FindUnfit(const std::vector<double>& low, const std::vector<double>& high, std::size_t width) {
  if (low.size() != width || high.size() != width)
    return absl::StrCat("bounds of ", low.size(), " and ", high.size(), " numbers");
  for (std::size_t i = 0; i < width; ++i) {
    if (low[i] <= -kUnbounded || high[i] >= kUnbounded) return "a range without bounds";
    if (!(low[i] < high[i])) return absl::StrCat("the range ", low[i], " to ", high[i]);
  }
  return "";
}

}  // namespace

absl::StatusOr<ActionScale> ActionScale::FromSpace(const std::string& text, int width,
                                                   const std::string& path) {
  const auto refuse = [&](const std::string& found) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": expected an action space that is a Box with finite bounds of ", width,
                     " numbers, which are scaled to [-1, 1], found ", found,
                     "; scale the actions to [-1, 1] and write these bounds, or none"));
  };
  const absl::StatusOr<json> parsed = ParseJson(absl::StrReplaceAll(text, {{"Infinity", "1e300"}}));
  if (!parsed.ok() || !parsed->is_object()) return refuse(absl::StrCat("'", text.substr(0, 60), "'"));
  const json& space = *parsed;
  if (space.value("type", json()) != "Box")
    return refuse(absl::StrCat("a space of type ", space.value("type", json()).dump()));
  const auto low = Numbers(space, "low"), high = Numbers(space, "high");
  if (!low.has_value() || !high.has_value()) return refuse("none that are a list of numbers");
  if (const std::string unfit = FindUnfit(*low, *high, static_cast<std::size_t>(width)); !unfit.empty())
    return refuse(unfit);
  ActionScale scale;
  const auto is = [](double value) { return [value](double bound) { return bound == value; }; };
  if (std::all_of(low->begin(), low->end(), is(-1)) && std::all_of(high->begin(), high->end(), is(1)))
    return scale;
  for (std::size_t i = 0; i < low->size(); ++i) {
    scale.middle_.push_back(static_cast<float>(((*low)[i] + (*high)[i]) / 2));
    scale.half_.push_back(static_cast<float>(((*high)[i] - (*low)[i]) / 2));
  }
  return scale;
}

void ActionScale::Apply(absl::Span<float> actions) const {
  if (identity()) return;
  for (std::size_t i = 0; i < actions.size(); ++i) {
    const std::size_t dimension = i % middle_.size();
    actions[i] = (actions[i] - middle_[dimension]) / half_[dimension];
  }
}

}  // namespace dbr
