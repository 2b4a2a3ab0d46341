#include "replay/dataset/return_reader.h"

#include "core/check.h"
#include "core/returns.h"
#include "core/status_macros.h"

namespace dbr {
namespace {

constexpr int kChunk = 4096;

TransitionLayout WithReturn(TransitionLayout layout) {
  layout.return_width = 1;
  return layout;
}

}  // namespace

ReturnReader::ReturnReader(DatasetReader* reader, float discount)
    : reader_(reader),
      discount_(discount),
      layout_(WithReturn(reader->transition_layout())),
      chunk_(reader->transition_layout(), kChunk) {
  DBR_CHECK(discount >= 0 && discount < 1);
}

absl::StatusOr<absl::Span<const float>> ReturnReader::Next() {
  rows_.clear();
  for (;; ++next_) {
    if (next_ == chunk_.size) {
      ASSIGN_OR_RETURN(const int size, reader_->Next(&chunk_));
      next_ = 0;
      if (size == 0) break;
    }
    if (chunk_.starts[static_cast<std::size_t>(next_)] != 0 && !rows_.empty()) break;
    const std::size_t end = rows_.size();
    rows_.resize(end + static_cast<std::size_t>(layout_.stride()));
    WriteRow(ViewRow(chunk_.row(next_), chunk_.layout), layout_, rows_.data() + end);
  }
  if (!rows_.empty()) {
    FillReturns(layout_, StationaryContinuation(layout_, discount_, rows_), absl::MakeSpan(rows_));
  }
  return absl::MakeConstSpan(rows_);
}

}  // namespace dbr
