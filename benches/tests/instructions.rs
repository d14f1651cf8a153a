//! No step becomes dearer unnoticed: instructions of a step, counted by callgrind, against the committed table.
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::thread;

use residual_benches::machine::said_by;
use residual_benches::steps::instructions::WARM_UP_PERIODS;
use residual_benches::steps::instructions::callgrind::{self, Counted};
use residual_benches::steps::instructions::table::{InstructionTable, STEPS, complaint, conditions};

/// One case of each method, and the whole ones of the filters with two gains.
const CASES: [&str; 6] = [
    "hinf_filter riccati n=2",
    "chi_square all, changing models n=4",
    "reduced_order_observer joint with bank n=2",
    "async_imm sequential n=4",
    "unknown_input_filter fixed n=4 s=40",
    "unknown_input_filter row_wise n=4 s=40",
];

fn program() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_residual-bench"))
}

fn table_path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/instructions.txt")
}

fn count(case: &str) -> Counted {
    callgrind::count(program(), case, WARM_UP_PERIODS * STEPS, STEPS, false).unwrap()
}

#[test]
fn a_step_takes_as_many_instructions_as_the_table_says() {
    if callgrind::valgrind().is_none() {
        println!("skipped: there is no valgrind");
        return;
    }
    let counted: Vec<Counted> = thread::scope(|scope| {
        let running = CASES.map(|case| scope.spawn(move || count(case)));
        running.map(|thread| thread.join().unwrap()).into()
    });
    let now = InstructionTable {
        conditions: conditions(&said_by("rustc", "--version"), &counted[0]),
        counts: counted
            .iter()
            .zip(CASES)
            .map(|(counted, case)| (counted.instructions, case.to_owned()))
            .collect(),
    };
    if std::env::var_os("RENEW_INSTRUCTION_COUNTS").is_some() {
        std::fs::write(table_path(), now.text()).unwrap();
        return;
    }
    let table = InstructionTable::parse(&std::fs::read_to_string(table_path()).unwrap());
    if table.conditions != now.conditions {
        println!(
            "skipped: the table is of {:?}, this is {:?}",
            table.conditions, now.conditions
        );
        return;
    }
    let complaints = now
        .counts
        .iter()
        .filter_map(|(count, case)| complaint(case, table.count_of(case), *count));
    let complaints: Vec<String> = complaints.collect();
    assert!(complaints.is_empty(), "\n{}", complaints.join("\n"));
}
