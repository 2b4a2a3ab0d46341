// The writers of a store, and how far each has come: what keeps a row that is sent again from being stored
// twice.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace dbr {

// Where a row comes from: an actor, or the offline data of the seed buffer.
enum class Source : std::uint32_t { kOnline = 0, kSeedBuffer = 1 };

// What a writer says of itself when it opens a stream.
struct WriterIdentity {
  std::uint64_t id = 0;  // not 0
  std::string name;      // 1 to 63 bytes
  Source source = Source::kOnline;
};

// A writer as it lies in the store's file: the layout is a format on disk (StoreFile, kFormat). An id of 0 is
// an empty place.
struct WriterRecord {
  std::uint64_t id;
  std::uint64_t last_sequence;  // all rows up to it are stored, or were refused or dropped for good
  std::uint64_t inserted;       // rows
  std::uint64_t duplicates;     // rows that it sent again
  std::uint64_t refused;        // rows with values that make no sense
  std::uint64_t opened;         // counts the openings of all writers: the smallest is the one longest away
  Source source;
  char name[64];
};

// The records of all writers, which lie in the store's memory, and what is known of them while the process
// lives. When all places are taken, a new writer gets the place of one that has no row in the buffer and no
// stream, the one longest away first. Thread-compatible: the buffer's mutex guards it.
class WriterTable {
 public:
  static constexpr std::size_t kPlaces = 4096;

  // `records`: kPlaces of them, zero or from an earlier process. They outlive the table.
  explicit WriterTable(WriterRecord* records);

  // Opens a stream of a writer, known or new, and returns its place. InvalidArgument for an id of 0 or a bad
  // name; ResourceExhausted where all places are in use.
  absl::StatusOr<std::uint32_t> Open(const WriterIdentity& identity);
  void Close(std::uint32_t place) { --volatile_[place].streams; }

  // The record at a place that Open gave, or any place below kPlaces.
  WriterRecord& record(std::uint32_t place) { return records_[place]; }
  const WriterRecord& record(std::uint32_t place) const { return records_[place]; }

  // Rows of the writer in the buffer.
  std::uint64_t held(std::uint32_t place) const { return volatile_[place].held; }
  void AddHeld(std::uint32_t place, std::int64_t rows) { volatile_[place].held += rows; }
  // Whether the writer has a stream open.
  bool connected(std::uint32_t place) const { return volatile_[place].streams > 0; }

 private:
  struct Volatile {
    std::uint64_t held = 0;  // rows in the buffer
    int streams = 0;
  };

  absl::StatusOr<std::uint32_t> FindFreePlace() const;

  WriterRecord* const records_;
  std::vector<Volatile> volatile_;
  absl::flat_hash_map<std::uint64_t, std::uint32_t> places_;  // by id
  std::uint64_t openings_ = 0;
};

}  // namespace dbr
