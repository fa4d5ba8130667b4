"""Jobs side by side, each on a processor of its own.

What is run by a worker is kept on that worker's processor and so uses one thread, since the
programs take as many as they may use: the processor seconds of each are those of one core."""
import concurrent.futures
import multiprocessing
import os


def processors():
    return sorted(os.sched_getaffinity(0))


def settle(queue):
    os.sched_setaffinity(0, {queue.get()})


def workers(count=None):
    """An executor with so many workers (default: one for each processor). Jobs begin in the
    order in which they are submitted, so long ones are best first."""
    count = min(count or len(processors()), len(processors()))
    context = multiprocessing.get_context("fork")
    queue = context.SimpleQueue()
    for processor in processors()[:count]:
        queue.put(processor)
    return concurrent.futures.ProcessPoolExecutor(count, context, settle, (queue,))
