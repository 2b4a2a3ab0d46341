// Macros that leave a function on the first error.
#pragma once

#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

// NOLINTBEGIN(bugprone-macro-parentheses): a declaration cannot stand in parentheses.
#define DBR_CONCAT_INNER(a, b) a##b
#define DBR_CONCAT(a, b) DBR_CONCAT_INNER(a, b)

// Returns the absl::Status `expression` from the function where it is not ok.
#define RETURN_IF_ERROR(expression)                                                  \
  do {                                                                               \
    if (absl::Status dbr_status = (expression); !dbr_status.ok()) return dbr_status; \
  } while (false)

// Returns the error of the absl::StatusOr `expression`, or moves its value into `declaration`. Two
// statements: in an `if` it needs braces.
#define ASSIGN_OR_RETURN(declaration, expression) \
  ASSIGN_OR_RETURN_INNER(DBR_CONCAT(dbr_statusor_, __LINE__), declaration, expression)
#define ASSIGN_OR_RETURN_INNER(statusor, declaration, expression) \
  auto statusor = (expression);                                   \
  if (!statusor.ok()) return statusor.status();                   \
  declaration = std::move(statusor).value()
// NOLINTEND(bugprone-macro-parentheses)
