// SPDX-License-Identifier: Apache-2.0
// Nothing is said of registers: only for proofs without induction.
