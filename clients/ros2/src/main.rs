//! The `palpate-ros2` program: a ROS 2 node, or a recording that is played to a server.

use std::io::IsTerminal;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use palpate_ros2::parameters::Parameters;
use palpate_ros2::{node, play, ros_args};
use tracing_subscriber::EnvFilter;

/// Connects a robot that speaks ROS 2 with a Palpate server.
///
/// Parameters, remappings and namespaces as every node takes them:
/// palpate-ros2 --ros-args -p server:=http://127.0.0.1:7257 -r points:=/camera/depth/points --params-file FILE
#[derive(Parser)]
#[command(name = "palpate-ros2", version)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand)]
enum Command {
    /// Plays a rosbag2 recording in MCAP to the server, as if the robot did it again; needs no DDS.
    Play {
        /// The recording; one whose chunks are compressed goes through `mcap decompress` first.
        file: PathBuf,
    },
}

/// What the node is called unless `-r __node:=` says otherwise.
const NODE: &str = "palpate";

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("palpate-ros2: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), String> {
    let (ros, rest) = ros_args::split(std::env::args())?;
    let Arguments { command } = Arguments::parse_from(rest);
    let level = ros.log_level.as_deref().unwrap_or("info").to_lowercase();
    // `node:=level` is how ROS sets the level of one logger; the bridge has one.
    let level = level.rsplit(":=").next().unwrap_or("info").replace("fatal", "error");
    let filter =
        std::env::var("RUST_LOG").unwrap_or_else(|_| format!("{level},rustdds=error,ros2_client=error"));
    let filter = EnvFilter::try_new(&filter).map_err(|error| format!("log level {filter:?}: {error}"))?;
    let is_terminal = std::io::stderr().is_terminal();
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_ansi(is_terminal)
        .with_writer(std::io::stderr)
        .init();

    let names = ros.names(NODE)?;
    let parameters = Parameters::read(&ros.parameters, &names)?;
    let runtime = tokio::runtime::Runtime::new().map_err(|error| format!("no runtime: {error}"))?;
    match command {
        None => runtime.block_on(node::run(parameters, &names, &node::Network::from_environment()?)),
        Some(Command::Play { file }) => {
            let played = runtime.block_on(play::play(&file, parameters, &names))?;
            println!("{played}");
            Ok(())
        }
    }
}
