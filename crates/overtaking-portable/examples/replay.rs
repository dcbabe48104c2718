//! Simulates batches from files and prints the trace hash of each simulation, without Python.
//!
//! `replay [--level LEVEL] FILE ...`; `benchmarks/arm.py` writes the files: numbers in little-endian order,
//! in the order in which `simulate_batch` reads them.

use std::error::Error;
use std::fs::File;
use std::io::{BufReader, Read};
use std::sync::Arc;

use overtaking_core::{
    CourseTable, Inputs, ModelConstants, Output, ParameterSwitch, Road, RoadDirections, RoadPose,
    SIMULATION_NAMES, VEHICLE_NAMES, require_level, with_outputs,
};
use overtaking_portable::simulate_at;

/// A result with any error, for a program that only prints it.
type Outcome<T> = Result<T, Box<dyn Error>>;

/// Read the next `count` numbers of a file.
fn read_numbers<const SIZE: usize, T>(
    file: &mut impl Read,
    count: usize,
    from: fn([u8; SIZE]) -> T,
) -> Outcome<Vec<T>> {
    let mut bytes = vec![0; SIZE * count];
    file.read_exact(&mut bytes)?;
    Ok(bytes.as_chunks().0.iter().copied().map(from).collect())
}

/// Read as many numbers of a file as the array has that the caller expects.
fn read_array<const SIZE: usize, const N: usize, T>(
    file: &mut impl Read,
    from: fn([u8; SIZE]) -> T,
) -> Outcome<[T; N]> {
    let values = read_numbers(file, N, from)?;
    values.try_into().map_err(|_| "a short row".into())
}

/// Read float32 numbers of a file into an array.
fn read_floats<const N: usize>(file: &mut impl Read) -> Outcome<[f32; N]> {
    read_array(file, f32::from_le_bytes)
}

/// Read a friction table of `ModelConstants`.
fn read_friction_table(file: &mut impl Read) -> Outcome<[[f32; 4]; 3]> {
    Ok([read_floats(file)?, read_floats(file)?, read_floats(file)?])
}

/// Allocate all outputs of a batch, and call `$run` with them.
macro_rules! with_allocated_outputs {
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

/// Read a batch from a file and simulate it; returns the trace hashes, four words for each simulation.
fn simulate_batch(file: &mut impl Read, level: Option<&str>) -> Outcome<Vec<u32>> {
    let header = read_array(file, u64::from_le_bytes)?;
    let [
        simulations,
        slots,
        frames,
        steps_per_frame,
        num_lanes,
        has_switch,
        switch_step,
    ] = header.map(|number| number as usize);
    let [seed] = read_array(file, u64::from_le_bytes)?;
    let index = read_numbers(file, simulations, u64::from_le_bytes)?;
    let mut constants = ModelConstants::default();
    constants.set(&read_numbers(
        file,
        ModelConstants::NAMES.len(),
        f32::from_le_bytes,
    )?);
    constants.friction_new = read_friction_table(file)?;
    constants.friction_worn = read_friction_table(file)?;
    constants.friction_speeds = read_floats(file)?;
    constants.friction_films = read_floats(file)?;
    let (boundaries, film_path) = (read_floats(file)?, read_floats(file)?);
    let [overtaking_sign] = read_floats(file)?;
    let pose = RoadPose::from(read_floats(file)?);
    let [num_own_lanes, has_oncoming_traffic, length, edge_sum] = read_floats(file)?;
    let directions = RoadDirections {
        num_own_lanes: num_own_lanes as usize,
        has_oncoming_traffic: has_oncoming_traffic > 0.0,
        length,
        edge_sum,
        sight_along: [read_floats(file)?, read_floats(file)?, read_floats(file)?].into(),
        sight_against: [read_floats(file)?, read_floats(file)?, read_floats(file)?].into(),
        line_marks: [read_floats(file)?, read_floats(file)?, read_floats(file)?].into(),
    };
    let mut read_params = || -> Outcome<_> {
        let num_vehicle_numbers = VEHICLE_NAMES.len() * slots * simulations;
        let num_simulation_numbers = SIMULATION_NAMES.len() * simulations;
        Ok((
            read_numbers(file, num_vehicle_numbers, f32::from_le_bytes)?,
            read_numbers(file, num_simulation_numbers, f32::from_le_bytes)?,
        ))
    };
    let (vehicle, simulation) = read_params()?;
    let params_after_switch = if has_switch == 1 {
        Some(read_params()?)
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
    let switch = params_after_switch
        .as_ref()
        .map(|(vehicle, simulation)| ParameterSwitch {
            vehicle,
            simulation,
            scenario_index: &index,
            judgement_errors: None,
            step: switch_step as u32,
        });
    let run = |out: Output<'_>| -> Outcome<_> {
        let mut hashes = vec![0; 4 * simulations];
        let out = Output {
            trace_hash: &mut hashes,
            ..out
        };
        simulate_at(require_level(level)?, &inputs, switch.as_slice(), out)?;
        Ok(hashes)
    };
    with_outputs! { with_allocated_outputs! { inputs, frames, run } }
}

fn main() -> Outcome<()> {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    let level = arguments.first().is_some_and(|first| first == "--level");
    let level = level.then(|| arguments.drain(..2).nth(1)).flatten();
    for name in arguments {
        let mut file = BufReader::new(File::open(name)?);
        for hash in simulate_batch(&mut file, level.as_deref())?
            .as_chunks::<4>()
            .0
        {
            println!("{}", hash.map(|word| format!("{word:08x}")).concat());
        }
        if file.read(&mut [0])? > 0 {
            return Err("numbers are left over".into());
        }
    }
    Ok(())
}
