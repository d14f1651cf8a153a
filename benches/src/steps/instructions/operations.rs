//! Floating-point operations among executed instructions, by what `objdump -d` shows at their addresses.

use std::collections::HashMap;
use std::ops::AddAssign;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use super::callgrind::Place;
use crate::machine::said_by;

/// What an instruction computes; a fused multiply-add is two operations of its own class.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Additions, subtractions, multiplications.
    AddMultiply,
    /// Fused multiply-adds.
    Fused,
    /// Divisions.
    Divide,
    /// Square roots.
    Root,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::AddMultiply, Self::Fused, Self::Divide, Self::Root];

    /// Operations of one lane.
    pub fn operations(self) -> u64 {
        if self == Self::Fused { 2 } else { 1 }
    }
}

/// Numbers of double precision that one instruction works on: 1 (scalar), 2 (packed 128 bit), 4 (256) or 8 (512).
pub type Lanes = u64;

/// What an instruction computes, on how many lanes.
pub type Class = (Kind, Lanes);

/// Executed floating-point operations of each class.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Operations(pub HashMap<Class, u64>);

impl Operations {
    /// All of them.
    pub fn total(&self) -> u64 {
        self.0.values().sum()
    }

    /// Those of one class.
    pub fn of(&self, kind: Kind, lanes: Lanes) -> u64 {
        self.0.get(&(kind, lanes)).copied().unwrap_or(0)
    }

    /// Those on so many lanes.
    pub fn on(&self, lanes: Lanes) -> u64 {
        Kind::ALL.into_iter().map(|kind| self.of(kind, lanes)).sum()
    }
}

/// Whether there is an objdump.
pub fn is_available() -> bool {
    said_by("objdump", "--version").starts_with("GNU objdump")
}

/// Floating-point instructions of the objects that were seen, disassembled once each.
#[derive(Debug, Default)]
pub struct Disassembly(HashMap<String, HashMap<u64, Class>>);

impl Disassembly {
    /// The operations of these executions.
    ///
    /// # Errors
    /// objdump fails.
    pub fn operations(&mut self, executions: &HashMap<Place, u64>) -> Result<Operations> {
        let mut operations = Operations::default();
        for ((object, address), count) in executions {
            if !self.0.contains_key(object) {
                self.0.insert(object.clone(), floating_point(object)?);
            }
            if let Some(&(kind, lanes)) = self.0.get(object).and_then(|known| known.get(address)) {
                operations
                    .0
                    .entry((kind, lanes))
                    .or_default()
                    .add_assign(count * lanes * kind.operations());
            }
        }
        Ok(operations)
    }
}

/// Addresses and classes of all floating-point arithmetic in a file of machine code.
fn floating_point(object: &str) -> Result<HashMap<u64, Class>> {
    let mut command = Command::new("objdump");
    let output = command
        .args(["-d", "--no-show-raw-insn", object])
        .output()
        .context("objdump does not start")?;
    ensure!(
        output.status.success(),
        "objdump of {object} ended with {}",
        output.status
    );
    let text = String::from_utf8_lossy(&output.stdout);
    Ok(text.lines().filter_map(instruction).collect())
}

/// From a line `  address:\tmnemonic operands` to the class, if it is floating-point arithmetic of double precision.
fn instruction(line: &str) -> Option<(u64, Class)> {
    let (address, rest) = line.split_once(":\t")?;
    let address = u64::from_str_radix(address.trim(), 16).ok()?;
    let (mnemonic, operands) = rest.split_once(char::is_whitespace)?;
    let bare = mnemonic.strip_prefix('v').unwrap_or(mnemonic);
    let (operation, is_packed) = match bare.strip_suffix("pd") {
        Some(operation) => (operation, true),
        None => (bare.strip_suffix("sd")?, false),
    };
    let kind = match operation {
        "add" | "sub" | "mul" | "hadd" | "hsub" | "addsub" => Kind::AddMultiply,
        "div" => Kind::Divide,
        "sqrt" => Kind::Root,
        fused if fused.starts_with("fm") || fused.starts_with("fnm") => Kind::Fused,
        _ => return None,
    };
    let lanes = match is_packed {
        false => 1,
        true if operands.contains("%zmm") => 8,
        true if operands.contains("%ymm") => 4,
        true => 2,
    };
    Some((address, (kind, lanes)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arithmetic_is_told_from_moves_and_comparisons() {
        let class = |text: &str| instruction(&format!("   1a2b:\t{text}")).map(|(_, class)| class);
        assert_eq!(
            instruction("   1a2b:\tmulsd  %xmm1,%xmm0"),
            Some((0x1a2b, (Kind::AddMultiply, 1)))
        );
        assert_eq!(class("addpd  0x10(%rax),%xmm0"), Some((Kind::AddMultiply, 2)));
        assert_eq!(class("vaddpd %ymm1,%ymm0,%ymm0"), Some((Kind::AddMultiply, 4)));
        assert_eq!(class("vfmadd231pd %ymm1,%ymm0,%ymm0"), Some((Kind::Fused, 4)));
        assert_eq!(class("vfnmadd213sd %xmm1,%xmm0,%xmm0"), Some((Kind::Fused, 1)));
        assert_eq!(class("sqrtsd %xmm1,%xmm0"), Some((Kind::Root, 1)));
        assert_eq!(class("divpd  %xmm1,%xmm0"), Some((Kind::Divide, 2)));
        for other in [
            "movsd  %xmm1,%xmm0",
            "movapd %xmm1,%xmm0",
            "maxsd  %xmm1,%xmm0",
            "cmpltpd %xmm1,%xmm0",
            "ucomisd %xmm1,%xmm0",
            "unpcklpd %xmm1,%xmm0",
            "andpd  %xmm1,%xmm0",
            "call   10 <add>",
            "addss  %xmm1,%xmm0",
        ] {
            assert_eq!(class(other), None, "{other}");
        }
    }
}
