// The threads of OpenBLAS: one, always; we place threads ourselves.
#pragma once

namespace dbr {

// Keeps OpenBLAS from starting threads of its own for matrix products. At the start of each program that
// multiplies.
void UseOneBlasThread();

}  // namespace dbr
