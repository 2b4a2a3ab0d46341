// Manual pages: their files and sections, and what troff says of them.
#include "deploy/manual/man_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "core/file_io.h"
#include "tests/deploy/manual/small_program.h"
#include "tests/integration/dbr_process.h"
#include "tests/support/temp_dir.h"

namespace dbr {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kGroff[] = "/usr/bin/groff";

class ManPageTest : public testing::Test {
 protected:
  const SmallProgram small_;
  const std::vector<ManPage> pages_ = MakeManPages(ReadCommands(small_.app), "1.2.3");
};

TEST_F(ManPageTest, EachCommandHasAPageThatIsNamedAfterItsWords) {
  std::vector<std::string> files;
  for (const ManPage& page : pages_) files.push_back(page.file);
  EXPECT_THAT(files,
              ElementsAre("tool.1", "tool-run.1", "tool-data.1", "tool-data-record.1", "tool-data-info.1"));
  EXPECT_THAT(pages_[0].text,
              AllOf(HasSubstr(".SH COMMANDS"), HasSubstr("tool\\-data"), HasSubstr("dbr 1.2.3")));
  EXPECT_THAT(pages_[3].text, HasSubstr(".SH \"SEE ALSO\"\n\\fBtool\\fR(1), \\fBtool\\-data\\fR(1)"));
}

TEST_F(ManPageTest, OptionsComeWithValuesBoundsAndDefaults) {
  EXPECT_THAT(
      pages_[1].text,
      AllOf(HasSubstr(
                "\\fBtool run\\fR \\fB\\-\\-run\\-dir\\fR \\fIDIR\\fR [\\fIOPTION\\fR]... [\\fICONFIG\\fR]"),
            HasSubstr("\\fB\\-j\\fR, \\fB\\-\\-jobs\\fR \\fIN\\fR\nHow many at once. N in [1 \\- 9]."),
            HasSubstr("How it acts. Default: fast."), HasSubstr("Folder of the run. Required."),
            Not(HasSubstr("secret"))));
}

TEST_F(ManPageTest, AFooterIsDividedIntoSections) {
  EXPECT_THAT(
      pages_[1].text,
      AllOf(HasSubstr(".SH DESCRIPTION\nSaves all.\n"), HasSubstr(".SH \"EXIT STATUS\"\n0 in the end.\n"),
            HasSubstr(".SH EXAMPLES\n.nf\ntool run \\-\\-run\\-dir \\(aqa\\eb\\(aq\ntool run\n.fi\n")));
}

TEST_F(ManPageTest, TheOptionWritesThePagesAndEndsTheProgram) {
  const TempDir folder;
  SmallProgram program;
  AddManPagesOption(&program.app);
  const auto parse = [&program](std::string into) { program.app.parse("--man-pages " + into); };
  EXPECT_THROW(parse(folder / "man1"), CLI::Success);
  EXPECT_TRUE(std::filesystem::exists(folder / "man1/tool-data-info.1"));
  EXPECT_THROW(parse("/proc/none"), CLI::FileError);
}

TEST_F(ManPageTest, TroffHasNothingToComplainOf) {
  if (!std::filesystem::exists(kGroff)) GTEST_SKIP() << "groff is not installed";
  const TempDir folder;
  for (const ManPage& page : pages_) {
    ASSERT_TRUE(WriteFileAtomically(folder / page.file, page.text).ok());
    // RunProgram gives both streams: a warning would stand beside the text.
    const auto [status, output] = RunProgram(
        "/bin/sh",
        {"-c", std::string(kGroff) + " -man -Tutf8 -ww \"$1\" > /dev/null", "sh", folder / page.file});
    EXPECT_EQ(status, 0);
    EXPECT_EQ(output, "") << page.file;
  }
}

}  // namespace
}  // namespace dbr
