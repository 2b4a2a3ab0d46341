#include "replay/dataset/end_keys.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/strip.h"

namespace dbr {
namespace {

// Names in d3rlpy, RLDS, gymnasium, stable-baselines3, OGBench, robomimic, IQL and others, as Plain makes
// them. What they mean differs: `dones` is the end of the task to some and the end of the episode to others,
// `masks` and `discounts` are 0 at an end, `ends` are numbers of rows.
constexpr absl::string_view kNames[] = {"done",
                                        "notdone",
                                        "donefloat",
                                        "donesfloat",
                                        "donebool",
                                        "doneflag",
                                        "isdone",
                                        "episodedone",
                                        "terminal",
                                        "isterminal",
                                        "terminated",
                                        "isterminated",
                                        "termination",
                                        "terminalflag",
                                        "truncated",
                                        "istruncated",
                                        "truncation",
                                        "timeout",
                                        "istimeout",
                                        "timelimit",
                                        "episodeterminal",
                                        "episodeend",
                                        "episodestart",
                                        "episodeid",
                                        "episodeindex",
                                        "episodeindice",
                                        "episodeidx",
                                        "episodelength",
                                        "episodelen",
                                        "end",
                                        "isend",
                                        "isfirst",
                                        "islast",
                                        "isstart",
                                        "isfinal",
                                        "finalflag",
                                        "mask",
                                        "valid",
                                        "discount",
                                        "steptype",
                                        "trajend",
                                        "trajid",
                                        "trajindex",
                                        "trajlength",
                                        "trajlen",
                                        "trajstart",
                                        "trajectoryend",
                                        "trajectoryid",
                                        "trajectoryindex",
                                        "trajectorylength",
                                        "trajectorystart"};

// Lower case, without marks between words and without a plural's s.
std::string Plain(absl::string_view key) {
  std::string plain;
  for (const char letter : key) {
    if (absl::ascii_isalnum(static_cast<unsigned char>(letter)))
      plain.push_back(absl::ascii_tolower(static_cast<unsigned char>(letter)));
  }
  return std::string(absl::StripSuffix(plain, "s"));
}

bool TellsOfEnds(absl::string_view key) {
  return std::find(std::begin(kNames), std::end(kNames), Plain(key)) != std::end(kNames);
}

}  // namespace

absl::Status CheckEndKeys(const Hdf5File& file, const std::string& group,
                          absl::Span<const absl::string_view> read) {
  for (const std::string& key : file.Keys(group)) {
    if (!TellsOfEnds(key) || std::find(read.begin(), read.end(), key) != read.end()) continue;
    const std::string path = group.empty() ? key : absl::StrCat(group, "/", key);
    if (!file.IsArray(path)) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        file.path(), ": expected the ends of episodes in '", absl::StrJoin(read, "', '"), "' alone, found '",
        path, "' beside them, which other programs use for ends and mean different things by; ",
        "write into those what it says, and take it out of the file"));
  }
  return absl::OkStatus();
}

}  // namespace dbr
