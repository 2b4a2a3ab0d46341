#include "deploy/manual/man_page.h"

#include <CLI/CLI.hpp>
#include <filesystem>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "core/file_io.h"

namespace dbr {
namespace {

// A footer's lines by what they are about.
struct Footer {
  std::vector<std::string> description, exit_status, examples;
};

std::string Escape(absl::string_view text) {
  return absl::StrReplaceAll(
      text, {{"\\", "\\e"}, {"-", "\\-"}, {"'", "\\(aq"}, {"`", "\\(ga"}, {"^", "\\(ha"}, {"~", "\\(ti"}});
}

// A line of text, which a leading dot would turn into a macro.
std::string Line(absl::string_view text) {
  return absl::StrCat(absl::StartsWith(text, ".") ? "\\&" : "", Escape(text), "\n");
}

std::string Bold(absl::string_view text) {
  return absl::StrCat("\\fB", Escape(text), "\\fR");
}

std::string Italic(absl::string_view text) {
  return absl::StrCat("\\fI", Escape(text), "\\fR");
}

std::string Sentence(std::string text) {
  if (!text.empty() && !absl::StrContains(".!?:", text.substr(text.size() - 1))) text += '.';
  return text;
}

std::string PageName(const CommandFacts& command) {
  return absl::StrReplaceAll(command.name, {{" ", "-"}});
}

Footer DivideFooter(const std::string& text) {
  Footer footer;
  std::vector<std::string>* part = &footer.description;
  for (std::string line : std::vector<std::string>(absl::StrSplit(text, '\n'))) {
    if (absl::StartsWith(line, "Example")) {
      part = &footer.examples;
      line.erase(0, line.find(':') + 1);
    } else if (absl::StartsWith(line, "Exit status: ")) {
      part = &footer.exit_status;
      line.erase(0, line.find(':') + 1);
    }
    line = std::string(absl::StripAsciiWhitespace(line));
    if (!line.empty()) part->push_back(std::move(line));
  }
  return footer;
}

std::string Section(absl::string_view title, const std::vector<std::string>& lines) {
  if (lines.empty()) return "";
  std::string text = absl::StrCat(".SH ", title, "\n");
  for (const std::string& line : lines) text += Line(line);
  return text;
}

// "--seed N" or "CONFIG", as one types it.
std::string Usage(const OptionFacts& option) {
  if (option.names.empty()) return absl::StrCat(Italic(option.positional), option.repeated ? " ..." : "");
  return absl::StrCat(absl::StrJoin(option.names, ", ",
                                    [](std::string* out, const std::string& name) { *out += Bold(name); }),
                      option.value.empty() ? "" : absl::StrCat(" ", Italic(option.value)));
}

std::string Synopsis(const CommandFacts& command) {
  std::string text = absl::StrCat(".SH SYNOPSIS\n", Bold(command.name));
  bool optional = false;
  for (const OptionFacts& option : command.flags()) {
    optional = optional || !option.required;
    if (option.required) absl::StrAppend(&text, " ", Usage(option));
  }
  if (optional) absl::StrAppend(&text, " [", Italic("OPTION"), "]...");
  for (const OptionFacts& option : command.positionals())
    absl::StrAppend(&text, " ", option.required ? Usage(option) : absl::StrCat("[", Usage(option), "]"));
  if (!command.commands.empty()) absl::StrAppend(&text, " ", Italic("COMMAND"));
  return absl::StrCat(text, "\n");
}

// What there is to know of the value beside the help text: "N in [1 - 1024]; default 4".
std::string ValueText(const OptionFacts& option) {
  std::vector<std::string> facts;
  const std::size_t in = option.bounds.find(" in ");
  if (in != std::string::npos) facts.push_back(absl::StrCat(option.value, option.bounds.substr(in)));
  if (!option.default_value.empty()) facts.push_back(absl::StrCat("Default: ", option.default_value));
  if (option.required && !option.names.empty()) facts.push_back("Required");
  return facts.empty() ? "" : absl::StrCat(" ", absl::StrJoin(facts, ". "), ".");
}

std::string Options(absl::string_view title, const std::vector<OptionFacts>& options) {
  if (options.empty()) return "";
  std::string text = absl::StrCat(".SH ", title, "\n");
  for (const OptionFacts& option : options) {
    std::string usage = Usage(option);
    if (option.names.empty() && option.kind() == ValueKind::kChoice)
      absl::StrAppend(&usage, ": ", Escape(absl::StrReplaceAll(option.value, {{"|", ", "}})));
    absl::StrAppend(&text, ".TP\n", usage, "\n",
                    Line(absl::StrCat(Sentence(option.text), ValueText(option))));
  }
  return text;
}

std::string Commands(const CommandFacts& command) {
  if (command.commands.empty()) return "";
  std::string text = ".SH COMMANDS\n";
  for (const CommandFacts& below : command.commands) {
    absl::StrAppend(&text, ".TP\n", Bold(below.word()), "\n", Line(Sentence(below.text)), "See ",
                    Bold(PageName(below)), "(1).\n");
  }
  return text;
}

std::string Examples(const std::vector<std::string>& examples) {
  if (examples.empty()) return "";
  std::string text = ".SH EXAMPLES\n.nf\n";
  for (const std::string& example : examples) text += Line(example);
  return absl::StrCat(text, ".fi\n");
}

// `above`: the pages of the commands that this one belongs to.
void AppendPages(const CommandFacts& command, const std::vector<std::string>& above,
                 absl::string_view version, std::vector<ManPage>* pages) {
  const std::string name = PageName(command);
  const Footer footer = DivideFooter(command.footer);
  std::string text =
      absl::StrCat(".TH ", absl::AsciiStrToUpper(Escape(name)), " 1 \"\" \"dbr ", version,
                   "\" \"User Commands\"\n.SH NAME\n", Escape(name), " \\- ", Escape(command.text), "\n");
  absl::StrAppend(&text, Synopsis(command), Section("DESCRIPTION", footer.description), Commands(command),
                  Options("ARGUMENTS", command.positionals()), Options("OPTIONS", command.flags()),
                  Section("\"EXIT STATUS\"", footer.exit_status), Examples(footer.examples));
  std::vector<std::string> others = above;
  for (const CommandFacts& below : command.commands) others.push_back(PageName(below));
  if (!others.empty()) {
    const auto refer = [](std::string* out, const std::string& page) { *out += Bold(page) + "(1)"; };
    absl::StrAppend(&text, ".SH \"SEE ALSO\"\n", absl::StrJoin(others, ", ", refer), "\n");
  }
  pages->push_back({absl::StrCat(name, ".1"), std::move(text)});
  std::vector<std::string> path = above;
  path.push_back(name);
  for (const CommandFacts& below : command.commands) AppendPages(below, path, version, pages);
}

}  // namespace

std::vector<ManPage> MakeManPages(const CommandFacts& program, absl::string_view version) {
  std::vector<ManPage> pages;
  AppendPages(program, {}, version, &pages);
  return pages;
}

void AddManPagesOption(CLI::App* app) {
  const auto write = [app](const std::string& folder) {
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    absl::Status status = error ? ErrnoStatus(error.value(), "cannot create", folder) : absl::OkStatus();
    for (const ManPage& page : MakeManPages(ReadCommands(*app), DBR_VERSION))
      status.Update(WriteFileAtomically(absl::StrCat(folder, "/", page.file), page.text));
    if (!status.ok()) throw CLI::FileError(std::string(status.message()));
    throw CLI::Success();
  };
  app->add_option_function<std::string>("--man-pages", write)->trigger_on_parse()->group("");
}

}  // namespace dbr
