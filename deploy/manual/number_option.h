// The values of options that are whole numbers.
#pragma once

#include <cstdint>
#include <limits>

namespace CLI {
class Validator;
}

namespace dbr {

// Belongs on every numeric option: option->transform(WholeNumber(1, 1000)). It takes decimal digits alone
// that say `least` to `most`; CLI11 by itself turns -1 into 18446744073709551615 and reads 010 as 8. A value
// that is refused is a ValidationError with what was expected and found. Manual pages and --help show the
// bounds where they are not those of the type.
CLI::Validator WholeNumber(std::uint64_t least = 0,
                           std::uint64_t most = std::numeric_limits<std::uint64_t>::max());

}  // namespace dbr
