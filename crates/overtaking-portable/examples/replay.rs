//! Simulates batches from files and prints the trace hash of each simulation, without Python.
//!
//! `replay [--level LEVEL] FILE ...`; `benchmarks/arm.py` writes the files: numbers in little-endian order,
//! in the order in which `batch` reads them.

use std::error::Error;
use std::fs::File;
use std::io::{BufReader, Read};
use std::sync::Arc;

use overtaking_core::{
    CourseTable, Inputs, ModelConstants, Output, ParameterSwitch, Road, RoadDirections, RoadPose,
    SIMULATION_NAMES, VEHICLE_NAMES, require_level, with_outputs,
};
use overtaking_portable::simulate_at;

type Outcome<T> = Result<T, Box<dyn Error>>;

/// The next `count` numbers of a file.
fn numbers<const SIZE: usize, T>(
    file: &mut impl Read,
    count: usize,
    from: fn([u8; SIZE]) -> T,
) -> Outcome<Vec<T>> {
    let mut bytes = vec![0; SIZE * count];
    file.read_exact(&mut bytes)?;
    Ok(bytes.as_chunks().0.iter().copied().map(from).collect())
}

/// As many of the next numbers of a file as the caller's array holds.
fn row<const SIZE: usize, const N: usize, T>(
    file: &mut impl Read,
    from: fn([u8; SIZE]) -> T,
) -> Outcome<[T; N]> {
    let values = numbers(file, N, from)?;
    values.try_into().map_err(|_| "a short row".into())
}

/// The next floats of a file.
fn floats<const N: usize>(file: &mut impl Read) -> Outcome<[f32; N]> {
    row(file, f32::from_le_bytes)
}

/// A table of friction.
fn table(file: &mut impl Read) -> Outcome<[[f32; 4]; 3]> {
    Ok([floats(file)?, floats(file)?, floats(file)?])
}

/// Outputs in memory of their own, given to `$run`.
macro_rules! allocated {
    (
        {
            { $inputs:expr, $frames:expr, $run:expr }
            { $($(#[$doc:meta])* $field:ident: $kind:ty, $size:expr;)* }
        }
        $($(#[$meaning:meta])* $state:ident: $number:ty,)*
    ) => {{
        let sizes = Output::sizes($inputs.scenario_index.len(), $inputs.num_slots, $frames);
        let size = |name| sizes.iter().find(|known| known.0 == name).map_or(0, |known| known.1);
        $(let mut $field = vec![Default::default(); size(stringify!($field))];)*
        $(let mut $state = vec![Default::default(); size(stringify!($state))];)*
        $run(Output {
            $($field: &mut $field,)*
            $($state: &mut $state,)*
            frames: $frames,
            slots: $inputs.num_slots,
        })
    }};
}

/// Read and simulate a batch; its trace hashes, four words each.
fn batch(file: &mut impl Read, level: Option<&str>) -> Outcome<Vec<u32>> {
    let header = row(file, u64::from_le_bytes)?;
    let [
        simulations,
        slots,
        frames,
        steps_per_frame,
        num_lanes,
        branched,
        switch,
    ] = header.map(|number| number as usize);
    let [seed] = row(file, u64::from_le_bytes)?;
    let index = numbers(file, simulations, u64::from_le_bytes)?;
    let mut constants = ModelConstants::default();
    constants.set(&numbers(
        file,
        ModelConstants::NAMES.len(),
        f32::from_le_bytes,
    )?);
    constants.friction_new = table(file)?;
    constants.friction_worn = table(file)?;
    constants.friction_speeds = floats(file)?;
    constants.friction_films = floats(file)?;
    let (boundaries, film_path) = (floats(file)?, floats(file)?);
    let [overtaking_sign] = floats(file)?;
    let pose = RoadPose::from(floats(file)?);
    let [num_own_lanes, has_oncoming_traffic, length, edge_sum] = floats(file)?;
    let directions = RoadDirections {
        num_own_lanes: num_own_lanes as usize,
        has_oncoming_traffic: has_oncoming_traffic > 0.0,
        length,
        edge_sum,
        sight_along: [floats(file)?, floats(file)?, floats(file)?].into(),
        sight_against: [floats(file)?, floats(file)?, floats(file)?].into(),
        line_marks: [floats(file)?, floats(file)?, floats(file)?].into(),
    };
    let mut parameters = || -> Outcome<_> {
        let of_vehicles = VEHICLE_NAMES.len() * slots * simulations;
        let of_simulations = SIMULATION_NAMES.len() * simulations;
        Ok((
            numbers(file, of_vehicles, f32::from_le_bytes)?,
            numbers(file, of_simulations, f32::from_le_bytes)?,
        ))
    };
    let (vehicle, simulation) = parameters()?;
    let afterwards = if branched == 1 {
        Some(parameters()?)
    } else {
        None
    };
    let inputs = Inputs {
        vehicle: &vehicle,
        simulation: &simulation,
        scenario_index: &index,
        num_slots: slots,
        constants: Arc::new(constants),
        road: Arc::new(Road {
            num_lanes,
            boundaries,
            film_path,
            overtaking_sign,
            pose,
            directions,
            course_table: CourseTable::default(),
        }),
        seed,
        steps_per_frame: steps_per_frame as u32,
        action_log: None,
    };
    let later = afterwards
        .as_ref()
        .map(|(vehicle, simulation)| ParameterSwitch {
            vehicle,
            simulation,
            scenario_index: &index,
            judgement_errors: None,
            step: switch as u32,
        });
    let run = |out: Output<'_>| -> Outcome<_> {
        let mut hashes = vec![0; 4 * simulations];
        let out = Output {
            trace_hash: &mut hashes,
            ..out
        };
        simulate_at(require_level(level)?, &inputs, later.as_slice(), out)?;
        Ok(hashes)
    };
    with_outputs! { allocated! { inputs, frames, run } }
}

fn main() -> Outcome<()> {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    let level = arguments.first().is_some_and(|first| first == "--level");
    let level = level.then(|| arguments.drain(..2).nth(1)).flatten();
    for name in arguments {
        let mut file = BufReader::new(File::open(name)?);
        for hash in batch(&mut file, level.as_deref())?.as_chunks::<4>().0 {
            println!("{}", hash.map(|word| format!("{word:08x}")).concat());
        }
        if file.read(&mut [0])? > 0 {
            return Err("numbers are left over".into());
        }
    }
    Ok(())
}
