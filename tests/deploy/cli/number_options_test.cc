// Every numeric option of `dbr`, found by walking the tree of its commands: one that is added later is held
// to the same.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <vector>

#include "deploy/cli/command_line.h"
#include "deploy/manual/number_option.h"

namespace dbr {
namespace {

using testing::HasSubstr;

// What the option says to a value; "" where it takes it.
std::string Answer(CLI::Option* option, const std::string& value) {
  option->clear();
  option->add_result(value);
  try {
    option->run_callback();
  } catch (const CLI::ParseError& error) {
    return std::string("refused: ") + error.what();
  }
  return "";
}

// Calls `visit` for each option that takes a value and refuses words, in `app` and all below it.
void VisitNumbers(CLI::App* app, const std::function<void(const std::string&, CLI::Option*)>& visit) {
  for (CLI::Option* option : app->get_options()) {
    if (option->get_expected_max() == 0 || option->get_type_size() == 0) continue;  // flags
    if (option->get_group().empty()) continue;  // --man-pages, which takes a folder and ends the program
    if (!Answer(option, "abc").empty()) visit(app->get_name() + " " + option->get_name(), option);
  }
  for (CLI::App* command : app->get_subcommands([](CLI::App*) { return true; })) VisitNumbers(command, visit);
}

TEST(NumberOptionsTest, EachOneRefusesWhatIsNoWholeNumberInTheSameWords) {
  CLI::App app("", "dbr");
  int exit_code = 0;
  for (const auto add : {AddLaunch, AddStats, AddEvaluate, AddProbe, AddDataset, AddExperiment, AddReport,
                         AddAlgorithms, AddCompletion})
    add(&app, &exit_code);
  std::vector<std::string> found;
  VisitNumbers(&app, [&found](const std::string& name, CLI::Option* option) {
    found.push_back(name);
    for (const char* wrong : {"-1", "+1", "18446744073709551616", "99999999999999999999999999", "1x", "1 ",
                              " 1", "1e3", "0x10", "1.5", "", "abc"}) {
      EXPECT_THAT(Answer(option, wrong), HasSubstr("expected a whole number of ")) << name << " " << wrong;
      EXPECT_THAT(Answer(option, wrong), HasSubstr(std::string("found '") + wrong + "'")) << name;
    }
    EXPECT_EQ(Answer(option, "0010"), "") << name;
  });
  EXPECT_GE(found.size(), 7u) << "--seed of four commands, --seeds, --jobs, --episodes, --steps";
}

TEST(NumberOptionsTest, ANumberIsReadInDecimalUpToTheLargest) {
  CLI::App app;
  std::uint64_t value = 1;
  CLI::Option* option = app.add_option("--n", value)->transform(WholeNumber());
  for (const auto& [text, expected] : {std::pair{"010", std::uint64_t{10}}, std::pair{"0", std::uint64_t{0}},
                                       std::pair{"18446744073709551615", ~std::uint64_t{0}}}) {
    EXPECT_EQ(Answer(option, text), "");
    EXPECT_EQ(value, expected);
  }
  CLI::Option* bounded = app.add_option("--m", value)->transform(WholeNumber(2, 5));
  EXPECT_THAT(Answer(bounded, "6"), HasSubstr("expected a whole number of 2 to 5, found '6'"));
  EXPECT_NE(Answer(bounded, "1"), "");
  EXPECT_EQ(Answer(bounded, "5"), "");
}

}  // namespace
}  // namespace dbr
