// The parts of a report that are pictures.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "deploy/report/cells.h"
#include "deploy/report/document.h"
#include "deploy/report/drawings.h"
#include "deploy/report/scores.h"

namespace dbr::report {

// Final figures, published and ours: a picture for each quality of the offline data, one for online training,
// one for games.
void AddBars(const Runs& runs, const std::vector<Row>& rows, Document* document, Drawings* drawings);

// Learning curves of each row.
void AddCurves(const Runs& runs, const std::vector<Row>& rows, Document* document, Drawings* drawings);

// For each contender with ablations: table, bars and curves.
void AddAblations(const Runs& runs, const std::vector<Row>& rows, Document* document, Drawings* drawings);

// The Connect-4 board, where the grid has games. Appends to `notes` what could not be read.
absl::Status AddBoard(const Runs& runs, std::vector<std::string>* notes, Document* document,
                      Drawings* drawings);

}  // namespace dbr::report
