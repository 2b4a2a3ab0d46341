// A report's text before it is Markdown or HTML: plain text in blocks, with no markup of either.
#pragma once

#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/string_view.h"

namespace dbr::report {

struct Heading {
  int level = 2;  // the title is 1
  std::string text;
};

struct Paragraph {
  std::string text;
};

struct List {
  std::vector<std::string> items;
};

struct TableCell {
  std::string text;
  bool bold = false;
};

// A row with text in its first cell begins a group of rows.
struct Table {
  std::vector<std::string> header;
  std::vector<std::vector<TableCell>> rows;  // as long as the header each
  std::string fold;                          // what stands over it where it is folded away; empty: it is open
};

// Lines of text as they are.
struct Listing {
  std::string fold;
  std::string text;
};

// An SVG of the report's folder.
struct Picture {
  std::string file;  // from the report's folder: "plots/x.svg"
  std::string title;
  std::string caption;
};

using Block = std::variant<Heading, Paragraph, List, Table, Listing, Picture>;

struct Document {
  std::string title;
  std::vector<Block> blocks;

  template <class AnyBlock>
  void Add(AnyBlock block) {
    blocks.emplace_back(std::move(block));
  }
};

// GitHub's Markdown; figures are links to their files.
std::string Markdown(const Document& document);

// One file that needs no other: `svgs[i]` is the text of the document's i-th figure.
std::string Html(const Document& document, const std::vector<std::string>& svgs);

// Text for HTML, between tags or in quoted attributes.
std::string HtmlEscaped(absl::string_view text);

}  // namespace dbr::report
