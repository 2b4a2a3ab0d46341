#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "deploy/report/document.h"

namespace dbr::report {
namespace {

std::string Escaped(absl::string_view text) {
  return absl::StrReplaceAll(
      text,
      {{"\\", "\\\\"}, {"*", "\\*"}, {"`", "\\`"}, {"|", "\\|"}, {"<", "&lt;"}, {"[", "\\["}, {"\n", " "}});
}

std::string CellText(const TableCell& cell) {
  const std::string text = Escaped(cell.text);
  return cell.bold && !text.empty() ? absl::StrCat("**", text, "**") : text;
}

std::string Folded(const std::string& fold, const std::string& inside) {
  if (fold.empty()) return inside;
  return absl::StrCat("<details><summary>", HtmlEscaped(fold), "</summary>\n\n", inside, "\n</details>\n");
}

struct Writer {
  std::string operator()(const Heading& heading) const {
    return absl::StrCat(std::string(heading.level, '#'), " ", Escaped(heading.text), "\n");
  }
  std::string operator()(const Paragraph& paragraph) const { return Escaped(paragraph.text) + "\n"; }
  std::string operator()(const List& list) const {
    std::string text;
    for (const std::string& item : list.items) absl::StrAppend(&text, "- ", Escaped(item), "\n");
    return text;
  }
  std::string operator()(const Table& table) const {
    std::string text = "|";
    for (const std::string& name : table.header) absl::StrAppend(&text, " ", Escaped(name), " |");
    text += "\n|";
    for (std::size_t i = 0; i < table.header.size(); ++i) text += "---|";
    text += "\n";
    for (const std::vector<TableCell>& row : table.rows) {
      text += "|";
      for (const TableCell& cell : row) absl::StrAppend(&text, " ", CellText(cell), " |");
      text += "\n";
    }
    return Folded(table.fold, text);
  }
  std::string operator()(const Listing& listing) const {
    return Folded(listing.fold, absl::StrCat("```\n", listing.text, "```\n"));
  }
  std::string operator()(const Picture& figure) const {
    return absl::StrCat("![", Escaped(figure.title), "](", figure.file, ")\n\n", Escaped(figure.caption),
                        "\n");
  }
};

}  // namespace

std::string Markdown(const Document& document) {
  std::string text = absl::StrCat("# ", Escaped(document.title), "\n");
  for (const Block& block : document.blocks) absl::StrAppend(&text, "\n", std::visit(Writer{}, block));
  return text;
}

}  // namespace dbr::report
