#include <cstddef>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "deploy/report/document.h"

namespace dbr::report {
namespace {

constexpr char kStyle[] = R"(
body { max-width: 1500px; margin: 2rem auto; padding: 0 1rem; font: 16px/1.5 sans-serif; color: #222; background: #fff; }
h1, h2, h3 { line-height: 1.2; margin: 2rem 0 0.6rem; }
p, li { max-width: 75em; }
.wide { overflow-x: auto; margin: 1rem 0; }
table { border-collapse: collapse; font-size: 14px; font-variant-numeric: tabular-nums; }
th, td { padding: 0.25rem 0.7rem; text-align: left; white-space: nowrap; }
th { border-bottom: 2px solid #444; }
tr.first td { border-top: 1px solid #bbb; }
figure { margin: 1.5rem 0; }
figure svg { max-width: 100%; height: auto; }
figcaption { font-size: 14px; color: #444; }
pre { background: #f4f4f4; padding: 0.7rem; overflow-x: auto; font-size: 13px; }
summary { cursor: pointer; }
)";

std::string Element(absl::string_view tag, absl::string_view text) {
  return absl::StrCat("<", tag, ">", HtmlEscaped(text), "</", tag, ">\n");
}

std::string Folded(const std::string& fold, const std::string& inside) {
  if (fold.empty()) return inside;
  return absl::StrCat("<details>", Element("summary", fold), inside, "</details>\n");
}

// The <svg> element, under names that no other figure of the page has, and without the titles that gnuplot
// gives to its parts (a browser would show them under the pointer).
std::string Inline(const std::string& svg, const std::string& title, std::size_t number) {
  const std::size_t start = svg.find("<svg");
  if (start == std::string::npos) return "";
  std::string text = svg.substr(start);
  for (std::size_t at = text.find("<title>"); at != std::string::npos; at = text.find("<title>", at)) {
    const std::size_t end = text.find("</title>", at);
    if (end == std::string::npos) break;
    text.erase(at, end + 8 - at);
  }
  const std::string mark = absl::StrCat("f", number, "-");
  text = absl::StrReplaceAll(text, {{"id=\"", absl::StrCat("id=\"", mark)},
                                    {"id='", absl::StrCat("id='", mark)},
                                    {"href='#", absl::StrCat("href='#", mark)},
                                    {"url(#", absl::StrCat("url(#", mark)}});
  text.insert(4, absl::StrCat(" role=\"img\" aria-label=\"", HtmlEscaped(title), "\""));
  return text;
}

class Writer {
 public:
  explicit Writer(const std::vector<std::string>& svgs) : svgs_(svgs) {}

  std::string operator()(const Heading& heading) const {
    return Element(absl::StrCat("h", heading.level), heading.text);
  }
  std::string operator()(const Paragraph& paragraph) const { return Element("p", paragraph.text); }
  std::string operator()(const List& list) const {
    std::string text = "<ul>\n";
    for (const std::string& item : list.items) text += Element("li", item);
    return text + "</ul>\n";
  }
  std::string operator()(const Table& table) const {
    std::string text = "<div class=\"wide\"><table>\n<tr>";
    for (const std::string& name : table.header) text += Element("th", name);
    text += "</tr>\n";
    for (const std::vector<TableCell>& row : table.rows) {
      text += row.empty() || row[0].text.empty() ? "<tr>" : "<tr class=\"first\">";
      for (const TableCell& cell : row) {
        const std::string inside = HtmlEscaped(cell.text);
        absl::StrAppend(&text, "<td>", cell.bold ? absl::StrCat("<b>", inside, "</b>") : inside, "</td>");
      }
      text += "</tr>\n";
    }
    return Folded(table.fold, text + "</table></div>\n");
  }
  std::string operator()(const Listing& listing) const {
    return Folded(listing.fold, Element("pre", listing.text));
  }
  std::string operator()(const Picture& figure) {
    const std::string& svg = svgs_[figures_];
    ++figures_;
    return absl::StrCat("<figure>\n", Inline(svg, figure.title, figures_),
                        Element("figcaption", figure.caption), "</figure>\n");
  }

 private:
  const std::vector<std::string>& svgs_;
  std::size_t figures_ = 0;
};

}  // namespace

std::string HtmlEscaped(absl::string_view text) {
  return absl::StrReplaceAll(text, {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}});
}

std::string Html(const Document& document, const std::vector<std::string>& svgs) {
  std::string text = absl::StrCat("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n",
                                  "<meta name=\"viewport\" content=\"width=device-width\">\n",
                                  Element("title", document.title), "<style>", kStyle,
                                  "</style>\n</head>\n<body>\n", Element("h1", document.title));
  Writer writer(svgs);
  for (const Block& block : document.blocks) text += std::visit(writer, block);
  return text + "</body>\n</html>\n";
}

}  // namespace dbr::report
