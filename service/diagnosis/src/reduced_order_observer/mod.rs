//! Reduced-order observers with zonotopic residual bounds (method sheet 1 to 4).
//!
//! A plant x⁺ = A x + B (u + f) + D η, y = C x + v with bounded η and v is split into its measured part and a part
//! that the disturbance does not reach. One observer follows that part, a second one predicts the next output; the
//! prediction error is compared with the set that it can reach without a fault.
//!
//! | symbol | name in the code | shape | meaning |
//! |---|---|---|---|
//! | x, u, f, y | | n, m, m, p | state, command, actuator fault, output |
//! | η, v | disturbance, noise | q, p | bounded by a box and by vbar |
//! | T_c | `Plant::transformation` | n x n | \[C; N_c'\]: from here on C = \[I 0\] |
//! | z1 = x1, z2 = K x1 + x2 | `z1`, `z2` | p, nz = n - p | measured part, decoupled part |
//! | K, M | `Observer::k`, `Observer::m` | nz x p, p x p | gains, K D1 + D2 = 0 |
//! | F, J, A1, N | `Observer::f`, ... | | see `observer` |
//! | A_e, D_e | `Observer::a_e`, `Observer::d_e` | n x n, n x q | error system |
//! | X_j | `Reach::generators` | n x (q + p) | what disturbance and noise of one sample become after j samples |
//! | W | `ObserverDesign::tests` | nw x p | test rows; the outputs first |
//! | t | `ObserverDesign::thresholds` | (J + 1) x nw | half widths of the rows after a start from zero error |
//! | c, H | `centre`, `generators` | n, n x h | what is left of the start and of gaps: ⟨c, H⟩ |
//! | U | `Decoupling` | n x qu | unknown inputs that an observer keeps out of z2 |
//! | φ | an estimator's row | 1 x p | first row of (C U)⁺ |
//! | d | `generator_order` | | columns of a reduced set |
//! | P | `Certificate::p` | n x n | Lyapunov certificate of K and M |

mod achieved;
mod achieved_faults;
mod baseline;
mod baseline_construction;
pub mod candidates;
pub mod certificate;
mod channels;
pub mod closed_form;
pub mod decoupling;
pub mod design;
pub mod directions;
mod episode;
pub mod error;
mod filter;
pub mod floors;
pub mod gains;
mod gap;
mod inputs;
pub mod interval_box;
pub mod isolation_design;
mod isolation_verification;
mod joint;
mod joint_construction;
mod method;
pub mod observer;
pub mod observer_design;
mod observer_pair;
pub mod options;
mod options_validate;
pub mod plant;
pub mod reach;
mod responses;
pub mod source;
mod start;
mod state_interval;
pub mod synthesis;
mod test_row;
mod verification;
mod workspace;

pub use baseline::BaselineObserver;
pub use joint::ReducedOrderObserver;
